#include "simulation/rough_road.h"

#include <cmath>
#include <numbers>

namespace roadfix {
namespace {

// ISO 8608:2016: reference wave number and the range that its classes are defined for, cycles per metre.
constexpr double kReference = 0.1;
constexpr double kLongest = 0.011;
constexpr int kOctaves = 8;  // up to 2.8 cycles per metre
constexpr int kWavesPerOctave = 8;

// Bounce of a passenger car's body: 1 to 1.5 Hz, damped by 0.2 to 0.4 of the critical (Gillespie, Fundamentals of
// vehicle dynamics, 1992, chapter 5).
constexpr double kBounce = 2.0 * kPi * 1.3;  // rad/s
constexpr double kDamping = 0.3;
constexpr double kFastest = 2.0 * kPi * 4.0;  // rad/s: the spline's knots carry no more

}  // namespace

std::complex<double> body_response(double frequency) {
  const double r = frequency / kBounce;
  const std::complex<double> damper(0.0, 2.0 * kDamping * r);
  const double x = frequency / kFastest;
  const double x4 = x * x * x * x;
  return (1.0 + damper) / (1.0 - r * r + damper) / (1.0 + x4 * x4);
}

RoughRoad::RoughRoad(double roughness_m3, double wheelbase, double track_width, RandomStream random)
    : wheelbase_(wheelbase), track_width_(track_width) {
  if (roughness_m3 == 0.0) return;
  constexpr double kStep = std::numbers::ln2 / kWavesPerOctave;
  for (int i = 0; i < kOctaves * kWavesPerOctave; ++i) {
    const double cycles = kLongest * std::exp2((i + random.uniform()) / kWavesPerOctave);
    const double variance = 0.5 * kPi * roughness_m3 * kReference * kReference / cycles * kStep;  // (D.1.3)
    const double direction = 2.0 * kPi * random.uniform();
    const double phase = 2.0 * kPi * random.uniform();
    waves_.push_back({2.0 * kPi * cycles * Eigen::Vector2d(std::cos(direction), std::sin(direction)),
                      std::polar(std::sqrt(2.0 * variance), phase)});
  }
}

BodyDisplacement RoughRoad::at(const Eigen::Vector2d& place, double heading, const Eigen::Vector2d& velocity) const {
  const Eigen::Vector2d forward(std::cos(heading), std::sin(heading));
  const Eigen::Vector2d left(-forward.y(), forward.x());
  double rear = 0.0, front = 0.0, lean = 0.0;
  for (const Wave& w : waves_) {
    const std::complex<double> body =
        w.amplitude * std::polar(1.0, w.number.dot(place)) * body_response(w.number.dot(velocity));
    const std::complex<double> ahead = std::polar(1.0, w.number.dot(forward) * wheelbase_);
    const double half = 0.5 * w.number.dot(left) * track_width_;
    const double mean = std::cos(half);
    rear += mean * body.real();
    front += mean * (ahead * body).real();
    lean -= std::sin(half) * (body + ahead * body).imag();  // left less right, mean of the axles
  }
  return {rear, (rear - front) / wheelbase_, lean / track_width_};
}

}  // namespace roadfix
