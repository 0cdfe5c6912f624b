/// What stands between a point and the sun. All rays to the sun are parallel, so that a grid across them holds for each
/// of its cells the few triangles that can throw a shadow there.
#pragma once

#include <vector>

#include "simulation/scene/triangle.h"

namespace roadfix {

class SunGrid {
 public:
  SunGrid() = default;
  /// `to_sun` is a unit vector.
  SunGrid(const Float3& to_sun, std::vector<Triangle> triangles, double cell_m);

  /// -1 where a triangle lies between a point and `reach_m` further towards the sun; lanes not `active` give 0.
  [[nodiscard]] I8 shaded(const Lanes3& point, I8 active, float reach_m) const;

 private:
  struct Entry {
    float top;  ///< of the triangle above this cell, towards the sun
    std::uint32_t triangle;
  };
  void choose_grid(double cell_m);
  [[nodiscard]] bool blocked(std::size_t cell, const std::array<float, 3>& point, float height, float reach_m) const;
  /// use(cell, top) for each cell that the triangle may lie over.
  template <class Use>
  void for_cells(const Triangle& triangle, Use use) const;

  Float3 to_sun_{};
  Float3 across_[2]{};  ///< at right angles to it and to each other
  float begin_m_[2]{};  ///< the grid's corner
  float cells_per_m_ = 0.0F;
  int size_[2] = {0, 0};  ///< cells
  std::vector<Triangle> triangles_;
  std::vector<std::uint32_t> begin_;  ///< of each cell's entries, and the end of the last
  std::vector<Entry> entries_;        ///< the highest first
};

}  // namespace roadfix
