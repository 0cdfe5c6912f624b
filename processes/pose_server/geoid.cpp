#include "pose_server/geoid.h"

#include <GeographicLib/Geoid.hpp>
#include <array>
#include <cmath>

namespace roadfix {

namespace {

/// GeographicLib's data sets, the finest first.
constexpr std::array<const char*, 7> kGeoids = {"egm2008-1", "egm2008-2_5", "egm2008-5", "egm96-5",
                                                "egm96-15",  "egm84-15",    "egm84-30"};

}  // namespace

class GeoidModel::Data {
 public:
  Data(const std::string& name, const std::string& folder) : geoid(name, folder) {}
  GeographicLib::Geoid geoid;
};

GeoidModel::GeoidModel(std::unique_ptr<Data> data, std::string name) : data_(std::move(data)), name_(std::move(name)) {}
GeoidModel::~GeoidModel() = default;

std::unique_ptr<GeoidModel> GeoidModel::open(const std::string& name, const std::string& folder) {
  if (name == "none") return nullptr;
  if (name != "auto") {
    try {
      return std::unique_ptr<GeoidModel>(new GeoidModel(std::make_unique<Data>(name, folder), name));
    } catch (const std::exception& e) {
      throw GeoidError("geoid '" + name + "': " + e.what() +
                       " (Debian: apt-get install geographiclib-tools, geographiclib-get-geoids " + name + ")");
    }
  }
  for (const char* candidate : kGeoids) {
    try {
      return std::unique_ptr<GeoidModel>(new GeoidModel(std::make_unique<Data>(candidate, folder), candidate));
    } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch): not installed, the next one
    }
  }
  return nullptr;
}

std::optional<double> GeoidModel::separation_m(double lat_deg, double lon_deg) const {
  try {
    const double height = data_->geoid(lat_deg, lon_deg);
    return std::isfinite(height) ? std::optional(height) : std::nullopt;
  } catch (const std::exception&) {  // the file is shorter than its head says
    return std::nullopt;
  }
}

}  // namespace roadfix
