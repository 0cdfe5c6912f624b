/// What the pixels of a camera may see, tile by tile: lists of the triangles that cross a tile's bundle of rays and are
/// not hidden behind one that fills it. A ray then meets a handful of triangles instead of walking through a tree.
///
/// The lists are conservative: whatever a ray of the tile would hit first is in its list, so the nearest hit in the
/// list is the nearest of all. Floats find it in most lanes; where rounding could decide (at a face's very edge, or
/// between two faces in one plane), doubles go through the list. Its place on the face is computed in doubles always.
#pragma once

#include <vector>

#include "simulation/scene/ray_scene.h"

namespace roadfix {

/// A camera's picture cut into tiles, and the rays in each: x and y of (x, y, 1), camera axes.
class TileGrid {
 public:
  static constexpr int kWidth = 16;
  static constexpr int kHeight = 8;
  struct Bounds {
    float x0, x1, y0, y1;
  };
  TileGrid() = default;
  /// Rays of (width + 2) x (height + 2) pixels: a border of one pixel, which the tiles' bounds take in.
  TileGrid(int width, int height, const std::vector<float>& ray_x, const std::vector<float>& ray_y);

  [[nodiscard]] int columns() const { return columns_; }
  [[nodiscard]] int rows() const { return rows_; }
  [[nodiscard]] const Bounds& operator()(int column, int row) const {
    return tiles_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                  static_cast<std::size_t>(column)];
  }
  [[nodiscard]] const Bounds& picture() const { return picture_; }
  struct Range {
    int first, last;  ///< empty where last < first
  };
  /// Tiles that rays with x (y) in [low, high] may lie in.
  [[nodiscard]] Range columns_between(float low, float high) const { return between(low, high, left_, right_); }
  [[nodiscard]] Range rows_between(float low, float high) const { return between(low, high, top_, bottom_); }

 private:
  static Range between(float low, float high, const std::vector<float>& begin, const std::vector<float>& end);
  int columns_ = 0;
  int rows_ = 0;
  std::vector<Bounds> tiles_;
  Bounds picture_{};
  std::vector<float> left_, right_, top_, bottom_;  ///< of columns and rows, ascending
};

/// The lists of one view.
class TileLists {
 public:
  /// R: camera to enu; eye: window coordinates. The grid and the window outlive this.
  TileLists(const TileGrid& grid, const RayWindow& window, const Eigen::Matrix3f& R, const Eigen::Vector3f& eye);

  /// Fills the lists of a row of tiles; different rows at once if one likes.
  void fill(int row);
  /// What rays from the eye hit first; lengths of their direction are depths. Lanes 0 to 3 run through one tile of the
  /// row and lanes 4 to 7 through another or the same.
  [[nodiscard]] HitLanes intersect(int row, std::array<int, 2> columns, const Lanes3& direction) const;

 private:
  /// A triangle before the camera. An edge (a, b, c): rays with a x + b y + c < 0 pass outside of it, those above
  /// `slack` certainly inside.
  struct Seen {
    Float3 edge[3];
    float slack[3];
    bool has_edges;
    Float3 inverse_depth;  ///< of its plane, as such a function, known to depth_slack
    float depth_slack;
    float nearest;  ///< depth
    TileGrid::Range columns, rows;
    std::uint32_t triangle;
    Float3 from_eye;
    float length;  ///< of from_eye
  };
  struct Entry {
    float nearest;  ///< depth in this tile
    std::uint32_t seen;
  };
  struct Row {
    std::vector<Entry> entries;
    std::vector<std::uint32_t> begin;  ///< of each tile's entries, and the end of the last
  };
  /// The nearest triangles so far with bounds of their distances, and the lanes in which rounding decides.
  struct Nearest {
    I8 triangle;
    F8 near, far;
    I8 uncertain;
  };
  void search(int row, int column, const Lanes3& direction, Nearest& nearest) const;
  /// The same in doubles, for one ray.
  [[nodiscard]] int decide(int row, int column, const std::array<double, 3>& direction) const;
  [[nodiscard]] HitLanes hits(I8 triangle, const Lanes3& direction) const;
  void look_at(std::uint32_t face, const std::array<Eigen::Vector3f, 4>& corner);
  void add_triangle(std::uint32_t triangle, const Eigen::Vector3f& a, const Eigen::Vector3f& b,
                    const Eigen::Vector3f& c);

  const TileGrid& grid_;
  const RayWindow& window_;
  Eigen::Vector3f eye_;
  float longest_;           ///< of the rays' directions
  std::vector<Seen> seen_;  ///< the nearest first
  std::vector<Row> rows_;
};

}  // namespace roadfix
