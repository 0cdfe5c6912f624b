/// A configuration with one key of every kind.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace roadfix::test {

enum class Mode { kKlt, kOrb };

struct Gate {
  double time = 1.5;
};

template <class Visitor>
void visit(Gate& c, Visitor& v) {
  v.number("time_s", c.time, 0.0, 10.0);
}

struct SampleConfig {
  std::string name = "none";
  double gyro_noise = 1e-3;
  int window = 10;
  bool use_mag = true;
  Mode mode = Mode::kKlt;
  Eigen::Vector3d lever_arm = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 2, 2> soft = Eigen::Matrix2d::Identity();
  std::optional<double> x;
  std::optional<int> width;
  std::optional<bool> on;
  std::optional<std::string> note;
  std::optional<Mode> other_mode;
  std::optional<Eigen::Vector2d> point;
  std::optional<Gate> extra;
  std::vector<double> weights;
  std::vector<int64_t> stamps;
  std::vector<std::string> words;
  std::vector<Mode> modes;
  std::vector<Gate> gates;
  Gate gate;
};

template <class Visitor>
void visit(SampleConfig& c, Visitor& v) {
  v.text("name", c.name);
  v.number("gyro_noise_radps_per_rthz", c.gyro_noise, 1e-7, 1.0);
  v.integer("window", c.window, 1, 1000);
  v.boolean("use_mag", c.use_mag);
  v.choice("mode", c.mode, {{"klt", Mode::kKlt}, {"orb", Mode::kOrb}});
  v.vector("lever_arm_m", c.lever_arm, -20.0, 20.0);
  v.vector("soft", c.soft, -2.0, 2.0);
  v.optional_number("x_m", c.x, -1e308, 1e308);
  v.optional_integer("width_px", c.width, 1, 100);
  v.optional_boolean("on", c.on);
  v.optional_text("note", c.note);
  v.optional_choice("other_mode", c.other_mode, {{"klt", Mode::kKlt}, {"orb", Mode::kOrb}});
  v.optional_vector("point_m", c.point, -1.0, 1.0);
  v.optional_group("extra", c.extra);
  v.numbers("weights", c.weights, 0.0, 1.0);
  v.integers("stamps", c.stamps, INT64_MIN, INT64_MAX);
  v.texts("words", c.words);
  v.choices("modes", c.modes, {{"klt", Mode::kKlt}, {"orb", Mode::kOrb}});
  v.groups("gates", c.gates);
  v.group("gate", c.gate);
  v.check("window", c.window % 2 == 0, "must be even");
}

}  // namespace roadfix::test
