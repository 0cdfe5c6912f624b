#include "config/config.h"
#include "roadfix/import/drive_folder.h"

namespace roadfix {
namespace {

constexpr double kMaxSeconds = 1e6;  // s, eleven days: longer than any drive

}  // namespace

template <class Visitor>
void visit(OutagePlan& c, Visitor& v) {
  v.require("length_s");
  v.number("length_s", c.length, 1e-3, kMaxSeconds);
  v.number("first_s", c.first, 0.0, kMaxSeconds);
  v.require("every_s");
  v.number("every_s", c.every, 1e-3, kMaxSeconds);
  v.check("every_s", c.every >= c.length, "must not be shorter than length_s");
  v.numbers("phases_s", c.phases, 0.0, kMaxSeconds);
}

template <class Visitor>
void visit(ReferenceDescription& c, Visitor& v) {
  v.choice("of", c.of,
           {{"imu", ReferenceOf::kImu},
            {"antenna", ReferenceOf::kAntenna},
            {"rear_axle", ReferenceOf::kRearAxle},
            {"none", ReferenceOf::kNone}});
  v.boolean("attitude", c.attitude);
  v.number("sigma_m", c.sigma, 0.0, 1000.0);
}

template <class Visitor>
void visit(DriveDescription& c, Visitor& v) {
  v.text("name", c.name);
  v.text("origin", c.origin);
  v.text("note", c.note);
  visit(c.calibration, v);
  v.group("reference", c.reference);
  v.group("score", c.score);
  v.groups("windows", c.windows);
}

DriveDescription parse_drive_description(const std::string& text, const std::string& file) {
  return parse_config<DriveDescription>(text, file);
}

}  // namespace roadfix
