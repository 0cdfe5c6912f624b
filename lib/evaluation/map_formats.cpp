#include "evaluation/map_formats.h"

#include <fmt/format.h>

#include "evaluation/trajectory_formats.h"
#include "geometry/frames.h"

namespace roadfix {
namespace {

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string coordinate(double radians) { return fmt::format("{:.9f}", radians / kDegree); }  // 0.1 mm

struct Place {
  int64_t t_us = 0;
  Geodetic geodetic;
  SeaLevel sea_level;
};

/// Poses of one validity that follow each other.
struct Stretch {
  Validity validity = Validity::kInvalid;
  std::vector<Place> places;
};

std::vector<Stretch> stretches(const Trajectory& trajectory, const Geodetic& anchor, const SeaLevelOf& sea_level) {
  const EnuAnchor enu(anchor);
  std::vector<Stretch> out;
  for (const Odometry& pose : trajectory.poses) {
    if (out.empty() || out.back().validity != pose.validity) out.push_back({pose.validity, {}});
    if (pose.validity == Validity::kInvalid) continue;
    const Geodetic g = enu.geodetic(pose.T_frame_vehicle.p);
    out.back().places.push_back({pose.t_us, g, sea_level(g)});
  }
  return out;
}

/// Longitude, latitude and where it is known height, as KML has them.
std::string coordinates(const Place& p) {
  std::string text = coordinate(p.geodetic.longitude) + "," + coordinate(p.geodetic.latitude);
  if (p.sea_level.height_m) text += fmt::format(",{:.3f}", *p.sea_level.height_m);
  return text + "\n";
}

void write_line(std::ostream& out, const Stretch& stretch, const Place* before) {
  bool high = true;
  std::string line;
  if (before != nullptr) {  // no hole in the line where the validity changes
    line = coordinates(*before);
    high = before->sea_level.height_m.has_value();
  }
  for (const Place& p : stretch.places) {
    line += coordinates(p);
    high = high && p.sea_level.height_m.has_value();
  }
  const bool valid = stretch.validity == Validity::kValid;
  out << "<Placemark><name>" << (valid ? "valid" : "coasting") << "</name><TimeSpan><begin>"
      << iso_time(stretch.places.front().t_us) << "</begin><end>" << iso_time(stretch.places.back().t_us)
      << "</end></TimeSpan><styleUrl>#" << (valid ? "valid" : "coasting") << "</styleUrl>\n<LineString><altitudeMode>"
      << (high ? "absolute" : "clampToGround") << "</altitudeMode><coordinates>\n"
      << line << "</coordinates></LineString></Placemark>\n";
}

}  // namespace

void write_gpx(std::ostream& out, const Trajectory& trajectory, const Geodetic& anchor, const std::string& name,
               const SeaLevelOf& sea_level) {
  out << "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
         "<gpx version=\"1.1\" creator=\"roadfix\" xmlns=\"http://www.topografix.com/GPX/1/1\">\n<trk><name>"
      << escaped(name) << "</name>\n";
  bool open = false;
  for (const Stretch& stretch : stretches(trajectory, anchor, sea_level)) {
    const bool wanted = stretch.validity != Validity::kInvalid;
    if (wanted != open) out << (wanted ? "<trkseg>\n" : "</trkseg>\n");
    open = wanted;
    for (const Place& p : stretch.places) {
      out << "<trkpt lat=\"" << coordinate(p.geodetic.latitude) << "\" lon=\"" << coordinate(p.geodetic.longitude)
          << "\">";
      if (p.sea_level.height_m) out << fmt::format("<ele>{:.3f}</ele>", *p.sea_level.height_m);
      out << "<time>" << iso_time(p.t_us) << "</time>";
      if (p.sea_level.separation_m) out << fmt::format("<geoidheight>{:.3f}</geoidheight>", *p.sea_level.separation_m);
      if (stretch.validity == Validity::kCoasting) out << "<fix>none</fix>";
      out << "</trkpt>\n";
    }
  }
  if (open) out << "</trkseg>\n";
  out << "</trk>\n</gpx>\n";
}

void write_kml(std::ostream& out, const Trajectory& trajectory, const Geodetic& anchor, const std::string& name,
               const SeaLevelOf& sea_level) {
  out << "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<kml xmlns=\"http://www.opengis.net/kml/2.2\">\n<Document><name>"
      << escaped(name)
      << "</name>\n"
         "<Style id=\"valid\"><LineStyle><color>ff3fa535</color><width>3</width></LineStyle></Style>\n"
         "<Style id=\"coasting\"><LineStyle><color>ff0080ff</color><width>3</width></LineStyle></Style>\n";
  const Place* before = nullptr;
  const std::vector<Stretch> all = stretches(trajectory, anchor, sea_level);
  for (const Stretch& stretch : all) {
    if (!stretch.places.empty()) write_line(out, stretch, before);
    before = stretch.places.empty() ? nullptr : &stretch.places.back();
  }
  out << "</Document>\n</kml>\n";
}

}  // namespace roadfix
