#include "simulation/faults.h"

#include <charconv>
#include <stdexcept>

namespace roadfix {
namespace {

constexpr const char* kSensorNames[] = {"imu", "gnss", "wheels", "mag", "camera"};

struct CommonFault {
  FaultKind kind;
  const char* name;
  const char* does;
  std::vector<FaultParameter> parameters;
};

std::vector<CommonFault> common_faults() {
  return {
      {FaultKind::kSilence, "silence", "gives nothing", {}},
      {FaultKind::kDrop, "drop", "messages are lost on the way", {{"probability", 0.2, 0.0, 1.0}}},
      {FaultKind::kRepeat, "repeat", "messages arrive twice", {{"probability", 0.2, 0.0, 1.0}}},
      {FaultKind::kStuck, "stuck", "repeats its last values under new stamps", {}},
      {FaultKind::kClock, "clock", "stamps are off", {{"offset_s", 0.05, -10.0, 10.0}}},
      {FaultKind::kDrift,
       "drift",
       "its clock runs fast from then on; a quartz is within 100 ppm",
       {{"ppm", 100.0, -1e5, 1e5}}},
      {FaultKind::kJitter, "jitter", "stamps scatter", {{"sigma_s", 0.003, 0.0, 1.0}}},
      {FaultKind::kDelay,
       "delay",
       "arrives later, each message by delay plus up to jitter: out of order where jitter is longer than the interval",
       {{"delay_s", 0.0, 0.0, 10.0}, {"jitter_s", 0.1, 0.0, 10.0}}},
  };
}

std::vector<FaultType> all_faults() {
  const std::vector<FaultParameter> factor = {{"factor", 3.0, 0.0, 1000.0}};
  std::vector<FaultType> types;
  for (std::size_t s = 0; s < std::size(kSensorNames); ++s) {
    for (const CommonFault& f : common_faults()) {
      types.push_back(
          {static_cast<Sensor>(s), f.kind, std::string(kSensorNames[s]) + "." + f.name, f.does, f.parameters});
    }
    types.push_back({static_cast<Sensor>(s), FaultKind::kNoise, std::string(kSensorNames[s]) + ".noise",
                     "white noise times factor, unknown to the sensor", factor});
  }
  const std::vector<FaultType> own = {
      {Sensor::kImu,
       FaultKind::kImuBias,
       "imu.bias",
       "adds to rate and specific force",
       {{"gyro_x_radps", 0.0, -10, 10},
        {"gyro_y_radps", 0.0, -10, 10},
        {"gyro_z_radps", 0.0, -10, 10},
        {"accel_x_mps2", 0.0, -100, 100},
        {"accel_y_mps2", 0.0, -100, 100},
        {"accel_z_mps2", 0.0, -100, 100}}},
      {Sensor::kImu,
       FaultKind::kSaturation,
       "imu.saturation",
       "clips at a full scale",
       {{"gyro_radps", 0.2, 0.0, 100}, {"accel_mps2", 12.0, 0.0, 1000}}},
      {Sensor::kGnss,
       FaultKind::kGnssBias,
       "gnss.bias",
       "moves the positions, sigma unchanged",
       {{"east_m", 0.0, -1e5, 1e5}, {"north_m", 0.0, -1e5, 1e5}, {"up_m", 0.0, -1e5, 1e5}}},
      {Sensor::kGnss,
       FaultKind::kRamp,
       "gnss.ramp",
       "moves the positions away at a constant speed, sigma unchanged",
       {{"east_mps", 0.5, -100, 100}, {"north_mps", 0.0, -100, 100}, {"up_mps", 0.0, -100, 100}}},
      {Sensor::kGnss,
       FaultKind::kMultipath,
       "gnss.multipath",
       "adds an error correlated over time (up: twice); the fix is single, its claimed sigma is true times claim",
       {{"sigma_m", 4.0, 0.0, 1000},
        {"correlation_s", 8.0, 0.1, 1e4},
        {"velocity_sigma_mps", 0.3, 0.0, 100},
        {"claim", 0.5, 1e-3, 1e3}}},
      {Sensor::kGnss,
       FaultKind::kReacquire,
       "gnss.reacquire",
       "begins displaced in some direction and comes back exponentially, sigma unchanged",
       {{"error_m", 5.0, 0.0, 1e4}, {"decay_s", 4.0, 0.01, 1e4}}},
      {Sensor::kGnss,
       FaultKind::kClaim,
       "gnss.claim",
       "claimed sigmas times factor, errors unchanged",
       {{"factor", 0.1, 1e-3, 1e3}}},
      {Sensor::kGnss,
       FaultKind::kLatency,
       "gnss.latency",
       "positions and velocities are older than their stamps",
       {{"position_s", 0.2, -2.0, 2.0}, {"velocity_s", 0.2, -2.0, 2.0}}},
      {Sensor::kGnss, FaultKind::kNoVelocity, "gnss.no_velocity", "fixes have no velocity", {}},
      {Sensor::kWheels,
       FaultKind::kSlip,
       "wheels.slip",
       "the driven rear wheels (or the one speed) turn faster by ratio",
       {{"ratio", 0.2, -1.0, 10.0}}},
      {Sensor::kWheels, FaultKind::kLock, "wheels.lock", "all wheels read zero", {}},
      {Sensor::kWheels, FaultKind::kScale, "wheels.scale", "all speeds larger by ratio", {{"ratio", 0.02, -1.0, 10.0}}},
      {Sensor::kWheels, FaultKind::kUnsigned, "wheels.unsigned", "speeds lose their sign, direction is unknown", {}},
      {Sensor::kMag,
       FaultKind::kDisturb,
       "mag.disturb",
       "adds a field in vehicle axes",
       {{"x_ut", 10.0, -1000, 1000}, {"y_ut", 10.0, -1000, 1000}, {"z_ut", 0.0, -1000, 1000}}},
      {Sensor::kCamera, FaultKind::kDark, "camera.dark", "light times factor", {{"factor", 0.01, 0.0, 1.0}}},
      {Sensor::kCamera,
       FaultKind::kWhite,
       "camera.white",
       "light is added everywhere, in shares of full scale",
       {{"glare", 1.5, 0.0, 10.0}}},
      {Sensor::kCamera,
       FaultKind::kOcclude,
       "camera.occlude",
       "something grey hides a share of the picture, from the left",
       {{"share", 0.5, 0.0, 1.0}}},
      {Sensor::kCamera,
       FaultKind::kCorrupt,
       "camera.corrupt",
       "the picture's file is damaged on the way",
       {{"probability", 0.5, 0.0, 1.0}}},
  };
  types.insert(types.end(), own.begin(), own.end());
  for (FaultType& type : types) {
    if (type.sensor != Sensor::kCamera) continue;
    for (const char* eye : {"left", "right"}) type.parameters.push_back({eye, 1.0, 0.0, 1.0});
  }
  return types;
}

double parse_number(std::string_view text, const std::string& whole) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) {
    throw std::invalid_argument("fault " + whole + ": \"" + std::string(text) + "\" is no number");
  }
  return value;
}

std::size_t parameter_index(const FaultType& type, std::string_view key) {
  std::string known;
  for (std::size_t i = 0; i < type.parameters.size(); ++i) {
    if (key == type.parameters[i].key) return i;
    known += std::string(i == 0 ? "" : ", ") + type.parameters[i].key;
  }
  throw std::invalid_argument("fault " + type.name + " has no parameter " + std::string(key) +
                              (known.empty() ? " (it has none)" : " (it has " + known + ")"));
}

void parse_parameters(std::string_view text, const std::string& whole, Fault& fault) {
  while (!text.empty()) {
    const std::string_view item = text.substr(0, text.find(','));
    text.remove_prefix(std::min(text.size(), item.size() + 1));
    const std::size_t equals = item.find('=');
    if (equals == std::string_view::npos) throw std::invalid_argument("fault " + whole + ": expected KEY=VALUE");
    const FaultParameter& p = fault.type().parameters[parameter_index(fault.type(), item.substr(0, equals))];
    const double value = parse_number(item.substr(equals + 1), whole);
    if (!(value >= p.min && value <= p.max)) {
      throw std::invalid_argument("fault " + whole + ": " + p.key + " must be within [" + std::to_string(p.min) + ", " +
                                  std::to_string(p.max) + "]");
    }
    fault.set(p.key, value);
  }
}

std::string shortest(double value) {
  std::array<char, 32> buffer{};
  const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return error == std::errc() ? std::string(buffer.data(), end) : std::string();
}

}  // namespace

const std::vector<FaultType>& fault_types() {
  static const std::vector<FaultType> types = all_faults();
  return types;
}

const FaultType* find_fault_type(std::string_view name) {
  for (const FaultType& type : fault_types()) {
    if (type.name == name) return &type;
  }
  return nullptr;
}

Fault::Fault(const FaultType& type, double start, double duration)
    : sensor(type.sensor), kind(type.kind), start_s(start), duration_s(duration) {
  for (std::size_t i = 0; i < type.parameters.size(); ++i) values[i] = type.parameters[i].fallback;
}

const FaultType& Fault::type() const {
  for (const FaultType& type : fault_types()) {
    if (type.sensor == sensor && type.kind == kind) return type;
  }
  throw std::invalid_argument("simulation: this sensor has no such fault");
}

double Fault::get(std::string_view key) const { return values[parameter_index(type(), key)]; }

void Fault::set(std::string_view key, double value) { values[parameter_index(type(), key)] = value; }

Fault parse_fault(const std::string& text) {
  const std::string_view all = text;
  const std::size_t at = all.find('@');
  if (at == std::string_view::npos) throw std::invalid_argument("fault " + text + ": expected SENSOR.KIND@START");
  const FaultType* type = find_fault_type(all.substr(0, at));
  if (type == nullptr) {
    throw std::invalid_argument("fault " + text + ": no fault of this name (roadfix simulate --list shows all)");
  }
  const std::size_t colon = all.find(':', at);
  const std::string_view when = all.substr(at + 1, colon == std::string_view::npos ? colon : colon - at - 1);
  const std::size_t plus = when.find('+');
  const double start = parse_number(when.substr(0, plus), text);
  const double duration = plus == std::string_view::npos ? kWholeDrive : parse_number(when.substr(plus + 1), text);
  const auto is_time = [](double t_s) { return t_s >= 0.0 && t_s <= kWholeDrive; };  // no NaN either
  if (!is_time(start) || !is_time(duration)) {
    throw std::invalid_argument("fault " + text + ": times are not negative, and at most 1e6 s");
  }
  Fault fault(*type, start, duration);
  if (colon != std::string_view::npos) parse_parameters(all.substr(colon + 1), text, fault);
  return fault;
}

std::string fault_text(const Fault& fault) {
  std::string text = fault.type().name + "@" + shortest(fault.start_s);
  if (fault.duration_s < kWholeDrive) text += "+" + shortest(fault.duration_s);
  for (std::size_t i = 0; i < fault.type().parameters.size(); ++i) {
    text += std::string(i == 0 ? ":" : ",") + fault.type().parameters[i].key + "=" + shortest(fault.values[i]);
  }
  return text;
}

}  // namespace roadfix
