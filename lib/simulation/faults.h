/// Things that go wrong, each at a time and for a while, in any scenario. A fault changes what its sensor gives between
/// start and start + duration (true time) and nothing else: no other sensor, no other sample, no other noise.
///
/// As text: `SENSOR.KIND@START[+DURATION]`[:KEY=VALUE,...], for example gnss.bias@30+5:east_m=15. Without a duration it
/// lasts to the end of the drive. Those of the camera can leave out one eye: camera.dark@10:right=0.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace roadfix {

enum class Sensor { kImu, kGnss, kWheels, kMag, kCamera };

enum class FaultKind {
  // Of every sensor.
  kSilence,
  kDrop,
  kRepeat,
  kStuck,
  kClock,
  kJitter,
  kDelay,
  // Of some.
  kNoise,
  kImuBias,
  kSaturation,
  kGnssBias,
  kRamp,
  kMultipath,
  kReacquire,
  kClaim,
  kLatency,
  kNoVelocity,
  kSlip,
  kLock,
  kScale,
  kUnsigned,
  kDisturb,
  kDark,
  kWhite,
  kOcclude,
  kCorrupt,
  // Of every sensor again: a kind's number is part of its seed, so that new ones come last.
  kDrift,
};

struct FaultParameter {
  const char* key;
  double fallback;
  double min;
  double max;
};

struct FaultType {
  Sensor sensor;
  FaultKind kind;
  std::string name;  ///< as in text: gnss.bias
  std::string does;
  std::vector<FaultParameter> parameters;
};

/// Every fault that there is.
const std::vector<FaultType>& fault_types();
/// Null where there is none of that name.
const FaultType* find_fault_type(std::string_view name);

inline constexpr double kWholeDrive = 1e6;  ///< s, a duration longer than any drive
inline constexpr std::size_t kMaxFaultParameters = 6;

struct Fault {
  Sensor sensor = Sensor::kGnss;
  FaultKind kind = FaultKind::kSilence;
  double start_s = 0.0;
  double duration_s = kWholeDrive;
  std::array<double, kMaxFaultParameters> values{};  ///< in the order of its type's parameters

  Fault() = default;
  /// With the fallback values of its parameters.
  Fault(const FaultType& type, double start, double duration);

  [[nodiscard]] const FaultType& type() const;
  [[nodiscard]] bool active(double t_s) const { return t_s >= start_s && t_s < start_s + duration_s; }
  /// Value of one parameter; the key must be one of its type's.
  [[nodiscard]] double get(std::string_view key) const;
  void set(std::string_view key, double value);
};

/// std::invalid_argument, saying what is wrong and what may be there.
Fault parse_fault(const std::string& text);
std::string fault_text(const Fault& fault);

template <class Visitor>
void visit(Fault& f, Visitor& v) {
  std::string name = f.type().name;
  v.require("kind");
  v.text("kind", name);
  const FaultType* type = find_fault_type(name);
  v.check("kind", type != nullptr, "must be the name of a fault (roadfix simulate --list)");
  if (type == nullptr) return;
  if (type != &f.type()) f = Fault(*type, f.start_s, f.duration_s);
  v.number("start_s", f.start_s, 0.0, 1e6);
  v.number("duration_s", f.duration_s, 0.0, kWholeDrive);
  for (std::size_t i = 0; i < type->parameters.size(); ++i) {
    const FaultParameter& p = type->parameters[i];
    v.number(p.key, f.values[i], p.min, p.max);
  }
}

}  // namespace roadfix
