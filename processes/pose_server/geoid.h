/// Heights of the geoid above the ellipsoid, from the data files of GeographicLib where they are installed.
#pragma once

#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

namespace roadfix {

/// A geoid that was asked for by name and is not there; the text says how it is installed.
struct GeoidError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class GeoidModel {
 public:
  /// "auto": the finest that is installed, null without one; "none": null; a name: that one, or GeoidError.
  /// `folder`: of the data files; empty: where GeographicLib looks.
  static std::unique_ptr<GeoidModel> open(const std::string& name, const std::string& folder);

  ~GeoidModel();
  GeoidModel(const GeoidModel&) = delete;
  GeoidModel& operator=(const GeoidModel&) = delete;

  /// m above the ellipsoid; absent where the file does not contain it.
  [[nodiscard]] std::optional<double> separation_m(double lat_deg, double lon_deg) const;
  [[nodiscard]] const std::string& name() const { return name_; }

 private:
  class Data;
  GeoidModel(std::unique_ptr<Data> data, std::string name);

  std::unique_ptr<Data> data_;
  std::string name_;
};

}  // namespace roadfix
