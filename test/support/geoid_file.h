/// A small geoid in GeographicLib's file format (its manual, "Geoid height"): 10 degrees between points.
#pragma once

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>

namespace roadfix::test {

/// `height_m(lat_deg, lon_deg)`: at the grid's points.
inline void write_geoid(const std::filesystem::path& folder, const std::string& name,
                        const std::function<double(double, double)>& height_m) {
  constexpr int kWidth = 36, kHeight = 19;
  constexpr double kOffset = -108.0, kScale = 0.003;
  std::ofstream out(folder / (name + ".pgm"), std::ios::binary);
  out << "P5\n# Geoid file in PGM format for the GeographicLib::Geoid class\n# Description A test, " << name
      << "\n# DateTime 2026-01-01 00:00:00\n# MaxBilinearError 0.1\n# RMSBilinearError 0.01\n# MaxCubicError 0.1\n"
         "# RMSCubicError 0.01\n# Offset "
      << kOffset << "\n# Scale " << kScale << "\n# Origin 90N 0E\n# AREA_OR_POINT Point\n# Vertical_Datum WGS84\n"
      << kWidth << " " << kHeight << "\n65535\n";
  for (int row = 0; row < kHeight; ++row) {
    for (int column = 0; column < kWidth; ++column) {
      const auto value =
          static_cast<unsigned>(std::lround((height_m(90.0 - 10.0 * row, 10.0 * column) - kOffset) / kScale));
      out.put(static_cast<char>(value >> 8U));
      out.put(static_cast<char>(value & 255U));
    }
  }
}

}  // namespace roadfix::test
