// Every fault acts within its time, on its sensor, and on nothing else; what faults and links do to the way of
// messages.
#include "simulation/faults.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <vector>

#include "unit/simulation/faulty_drive.h"

namespace roadfix {
namespace {

using test::drive_with;
using test::faulty_scenario;

/// What a message is made of: values, stamp, arrival.
using Row = std::vector<double>;
using Rows = std::map<std::int64_t, std::vector<Row>>;  // by the true time since the start

void begin(Rows& rows, const SimulatedDrive& drive, std::int64_t stamp, const Delivery& d, const Row& values) {
  const std::int64_t start = drive.config.start_utime;
  Row row = values;
  row.push_back(static_cast<double>(stamp - start));
  row.push_back(static_cast<double>(d.arrival_us - start));
  rows[d.true_us - start].push_back(row);
}

Rows rows_of(const SimulatedDrive& drive, Sensor sensor) {
  Rows rows;
  if (sensor == Sensor::kImu) {
    for (std::size_t i = 0; i < drive.imu.size(); ++i) {
      const ImuSample& s = drive.imu[i];
      begin(rows, drive, s.t_us, drive.deliveries.imu[i],
            {s.gyro.x(), s.gyro.y(), s.gyro.z(), s.accel.x(), s.accel.y(), s.accel.z()});
    }
  } else if (sensor == Sensor::kGnss) {
    for (std::size_t i = 0; i < drive.gnss.size(); ++i) {
      const GnssFix& s = drive.gnss[i];
      Row row = {s.antenna.latitude, s.antenna.longitude, s.antenna.height,
                 s.cov_enu(0, 0),    s.cov_enu(2, 2),     double(int(s.fix_type))};
      if (s.velocity) {
        row.insert(row.end(), s.velocity->enu.begin(), s.velocity->enu.end());
        row.push_back(s.velocity->cov_enu(0, 0));
      }
      begin(rows, drive, s.t_us, drive.deliveries.gnss[i], row);
    }
  } else if (sensor == Sensor::kWheels) {
    for (std::size_t i = 0; i < drive.wheels.size(); ++i) {
      const WheelSample& s = drive.wheels[i];
      Row row(s.speeds.begin(), s.speeds.end());
      row.push_back(double(int(s.direction)));
      begin(rows, drive, s.t_us, drive.deliveries.wheels[i], row);
    }
  } else if (sensor == Sensor::kCamera) {
    const auto add = [&](double eye, const std::vector<Picture>& pictures, const std::vector<Delivery>& deliveries) {
      for (std::size_t i = 0; i < pictures.size(); ++i) {
        const PictureEffects& e = pictures[i].effects;
        begin(rows, drive, pictures[i].t_us, deliveries[i],
              {eye, double(pictures[i].exposure), e.light_factor, e.glare, e.noise_factor, e.occluded_share,
               double(e.corruption)});
      }
    };
    add(0.0, drive.pictures_left, drive.deliveries.camera_left);
    add(1.0, drive.pictures_right, drive.deliveries.camera_right);
  } else {
    for (std::size_t i = 0; i < drive.mag.size(); ++i) {
      const MagSample& s = drive.mag[i];
      begin(rows, drive, s.t_us, drive.deliveries.mag[i], {s.field.x(), s.field.y(), s.field.z()});
    }
  }
  return rows;
}

Rows outside_window(Rows rows) {
  std::erase_if(rows, [](const auto& row) {
    const double t_s = static_cast<double>(row.first) * 1e-6;
    return test::during_fault(t_s);
  });
  return rows;
}

TEST_CASE("every fault changes its own sensor, within its time only") {
  const SimulatedDrive before = simulate(faulty_scenario(), 3);
  for (const FaultType& type : fault_types()) {
    CAPTURE(type.name);
    Fault fault(type, test::kFaultStart_s, test::kFaultDuration_s);
    for (std::size_t i = 0; i < type.parameters.size(); ++i) {
      if (fault.values[i] == 0.0) fault.values[i] = 0.5;  // an addend of zero would be no fault
    }
    const SimulatedDrive after = drive_with(fault_text(fault));
    for (const Sensor sensor : {Sensor::kImu, Sensor::kGnss, Sensor::kWheels, Sensor::kMag, Sensor::kCamera}) {
      const Rows a = rows_of(before, sensor);
      const Rows b = rows_of(after, sensor);
      if (sensor == type.sensor) {
        CHECK(a != b);
        CHECK(outside_window(a) == outside_window(b));
      } else {
        CHECK(a == b);
      }
    }
    CHECK(before.truth.size() == after.truth.size());
    CHECK(before.truth.back().T_frame_vehicle.p == after.truth.back().T_frame_vehicle.p);
  }
}

TEST_CASE("a fault of one eye leaves the other's pictures as they were") {
  const Rows before = rows_of(simulate(faulty_scenario(), 3), Sensor::kCamera);
  const auto of_eye = [](const Rows& rows, double eye) {
    Rows out = rows;
    for (auto& row : out) std::erase_if(row.second, [eye](const Row& r) { return r[0] != eye; });
    return out;
  };
  CHECK(of_eye(before, 0.0).at(0).size() == 1);
  for (const FaultType& type : fault_types()) {
    if (type.sensor != Sensor::kCamera) continue;
    CAPTURE(type.name);
    for (const double eye : {0.0, 1.0}) {
      Fault fault(type, test::kFaultStart_s, test::kFaultDuration_s);
      fault.set(eye == 0.0 ? "right" : "left", 0.0);
      const Rows after = rows_of(drive_with(fault_text(fault)), Sensor::kCamera);
      CHECK(of_eye(after, eye) != of_eye(before, eye));
      CHECK(of_eye(after, 1.0 - eye) == of_eye(before, 1.0 - eye));
    }
  }
}

TEST_CASE("both eyes' pictures of one exposure have one stamp") {
  const SimulatedDrive drive = drive_with("camera.jitter@20+30:sigma_s=0.01");
  REQUIRE(drive.pictures_left.size() == 801);
  REQUIRE(drive.pictures_right.size() == 801);
  int off = 0;
  for (std::size_t i = 0; i < 801; ++i) {
    CHECK(drive.pictures_left[i].t_us == drive.pictures_right[i].t_us);
    off += drive.pictures_left[i].t_us != drive.exposures[i] ? 1 : 0;
  }
  CHECK(off > 250);
}

TEST_CASE("errors and deliveries stay aligned with the samples") {
  ScenarioConfig config = faulty_scenario();
  for (const char* text : {"imu.drop@10", "imu.silence@40+5", "gnss.drop@0", "gnss.repeat@0", "wheels.repeat@5"}) {
    config.faults.push_back(parse_fault(text));
  }
  const SimulatedDrive drive = simulate(config, 3);
  CHECK(drive.imu.size() == drive.errors.imu_bias.size());
  CHECK(drive.imu.size() == drive.deliveries.imu.size());
  CHECK(drive.gnss.size() == drive.errors.gnss.size());
  for (std::size_t i = 0; i < drive.gnss.size(); ++i) {
    const Kinematics k = drive.kinematics_at(drive.deliveries.gnss[i].true_us);
    const Eigen::Vector3d error = drive.anchor.enu(drive.gnss[i].antenna) - k.T_enu_vehicle * config.gnss.lever_arm_m;
    REQUIRE((error - drive.errors.gnss[i].position).norm() < 1e-5);
  }
}

TEST_CASE("silence leaves no gap in seq and loss does") {
  const auto gaps = [](const std::vector<Delivery>& d) {
    int n = 0;
    for (std::size_t i = 1; i < d.size(); ++i) n += d[i].seq != d[i - 1].seq + 1;
    return n;
  };
  const SimulatedDrive silent = drive_with("gnss.silence@30+20");
  const SimulatedDrive lossy = drive_with("gnss.drop@30+20:probability=0.5");
  CHECK(gaps(silent.deliveries.gnss) == 0);
  CHECK(silent.gnss.size() == 401 - 100);
  CHECK(gaps(lossy.deliveries.gnss) > 10);
  CHECK(lossy.gnss.size() == Approx(401 - 50).margin(20));
}

TEST_CASE("clock and jitter move stamps, not the truth") {
  const SimulatedDrive offset = drive_with("imu.clock@30+20:offset_s=0.04");
  CHECK(offset.imu[3500].t_us - offset.deliveries.imu[3500].true_us == 40'000);
  CHECK(offset.imu[2000].t_us == offset.deliveries.imu[2000].true_us);
  const SimulatedDrive drift = drive_with("imu.drift@30+20:ppm=2000");
  CHECK(drift.imu[2999].t_us == drift.deliveries.imu[2999].true_us);
  CHECK(drift.imu[3999].t_us - drift.deliveries.imu[3999].true_us == 20'000);
  const SimulatedDrive jitter = drive_with("imu.jitter@0:sigma_s=0.002");
  double sum = 0.0;
  for (std::size_t i = 0; i < jitter.imu.size(); ++i) {
    sum += std::pow(seconds_between(jitter.deliveries.imu[i].true_us, jitter.imu[i].t_us), 2);
  }
  CHECK(std::sqrt(sum / static_cast<double>(jitter.imu.size())) == Approx(0.002).epsilon(0.03));
}

TEST_CASE("a jittering delay puts arrivals out of order, the normal link does not") {
  const auto disorder = [](const std::vector<Delivery>& d) {
    int n = 0;
    for (std::size_t i = 1; i < d.size(); ++i) n += d[i].arrival_us < d[i - 1].arrival_us;
    return n;
  };
  CHECK(disorder(simulate(faulty_scenario(), 3).deliveries.imu) == 0);
  CHECK(disorder(drive_with("imu.delay@30+20:delay_s=0.01,jitter_s=0.05").deliveries.imu) > 100);
}

TEST_CASE("what is repeated is the same message, in place of no other") {
  const SimulatedDrive before = simulate(faulty_scenario(), 3);
  const SimulatedDrive after = drive_with("gnss.repeat@30+20:probability=0.5");
  std::size_t doubled = 0;
  for (std::size_t i = 0, k = 0; i < after.gnss.size(); ++i, ++k) {
    REQUIRE(after.gnss[i].t_us == before.gnss[k].t_us);
    REQUIRE(after.gnss[i].antenna.latitude == before.gnss[k].antenna.latitude);
    CHECK(after.deliveries.gnss[i].seq == static_cast<std::int64_t>(k));
    if (i + 1 == after.gnss.size() || after.deliveries.gnss[i + 1].seq != after.deliveries.gnss[i].seq) continue;
    ++doubled;
    ++i;
    CHECK(after.gnss[i].antenna.latitude == before.gnss[k].antenna.latitude);
  }
  CHECK(after.gnss.size() == before.gnss.size() + doubled);
  CHECK(doubled == Approx(50).margin(20));
}

TEST_CASE("every sensor's link has its own offset, jitter, loss and disorder") {
  const auto link_of = [](ScenarioConfig& c, Sensor sensor) -> LinkConfig& {
    switch (sensor) {
      case Sensor::kImu:
        return c.imu.link;
      case Sensor::kGnss:
        return c.gnss.link;
      case Sensor::kWheels:
        return c.wheels.link;
      case Sensor::kMag:
        return c.mag.link;
      case Sensor::kCamera:
        break;
    }
    return c.camera.link;
  };
  const SimulatedDrive before = simulate(faulty_scenario(), 3);
  for (const Sensor sensor : {Sensor::kImu, Sensor::kGnss, Sensor::kWheels, Sensor::kMag, Sensor::kCamera}) {
    CAPTURE(int(sensor));
    ScenarioConfig config = faulty_scenario();
    LinkConfig& link = link_of(config, sensor);
    link = {.clock_offset_s = 0.25, .stamp_jitter_s = 0.002, .delay_s = 0.1, .delay_jitter_s = 0.5};
    link.drop_probability = 0.25;
    const SimulatedDrive after = simulate(config, 3);
    double late_s = 0.0;
    double squares = 0.0;
    double newest = 0.0;
    double disorder = 0.0;
    double count = 0.0;
    const Rows rows = rows_of(after, sensor);
    for (const auto& [true_us, list] : rows) {
      for (const Row& row : list) {
        const double stamp_s = 1e-6 * (row[row.size() - 2] - static_cast<double>(true_us));
        const double arrival_us = row[row.size() - 1];
        squares += std::pow(stamp_s - 0.25, 2);
        late_s = std::max(late_s, 1e-6 * (arrival_us - static_cast<double>(true_us)));
        disorder += arrival_us < newest ? 1.0 : 0.0;
        newest = std::max(newest, arrival_us);
        count += 1.0;
      }
    }
    std::size_t sent = 0;
    for (const auto& row : rows_of(before, sensor)) sent += row.second.size();
    CHECK(count / static_cast<double>(sent) == Approx(0.75).margin(0.06));
    CHECK(std::sqrt(squares / count) == Approx(0.002).epsilon(0.15));
    CHECK(late_s > 0.5);
    CHECK(late_s <= 0.6);
    CHECK(disorder > 0.1 * count);
    for (const Sensor other : {Sensor::kImu, Sensor::kGnss, Sensor::kWheels, Sensor::kMag, Sensor::kCamera}) {
      if (other != sensor) CHECK(rows_of(before, other) == rows_of(after, other));
    }
  }
}

TEST_CASE("clock offset and drift of a link") {
  ScenarioConfig config = faulty_scenario();
  config.gnss.link.clock_offset_s = -0.1;
  config.gnss.link.clock_drift_ppm = 1000.0;
  const SimulatedDrive drive = simulate(config, 3);
  const Delivery& last = drive.deliveries.gnss.back();
  CHECK(drive.gnss.back().t_us - last.true_us == -100'000 + 80'000);
}

TEST_CASE("faults as text: both ways, and errors that say what may be there") {
  const Fault fault = parse_fault("gnss.bias@30+5:east_m=15");
  CHECK(fault.sensor == Sensor::kGnss);
  CHECK(fault.start_s == 30.0);
  CHECK(fault.duration_s == 5.0);
  CHECK(fault.get("east_m") == 15.0);
  CHECK(fault_text(fault) == "gnss.bias@30+5:east_m=15,north_m=0,up_m=0");
  CHECK(fault_text(parse_fault("imu.silence@2.5")) == "imu.silence@2.5");
  const auto error = [](const std::string& text) -> std::string {
    try {
      parse_fault(text);
    } catch (const std::invalid_argument& e) {
      return e.what();
    }
    return "";
  };
  using Catch::Matchers::Contains;
  CHECK_THAT(error("gnss.bias"), Contains("@START"));
  CHECK_THAT(error("gnss.nonsense@3"), Contains("no fault of this name"));
  CHECK_THAT(error("gnss.bias@3:east=4"), Contains("east_m, north_m, up_m"));
  CHECK_THAT(error("gnss.bias@x"), Contains("\"x\" is no number"));
  CHECK_THAT(error("gnss.drop@1:probability=2"), Contains("within [0"));
  CHECK_THAT(error("gnss.bias@3+-4"), Contains("not negative"));
  for (const char* never : {"nan", "inf", "-inf", "1e300"}) {
    CAPTURE(never);
    CHECK_THAT(error("gnss.silence@" + std::string(never)), Contains("at most 1e6 s"));
    CHECK_THAT(error("gnss.silence@3+" + std::string(never)), Contains("at most 1e6 s"));
    CHECK_THAT(error("gnss.bias@3:east_m=" + std::string(never)), Contains("must be within"));
    CHECK_THAT(error("gnss.ramp@3:north_mps=" + std::string(never)), Contains("must be within"));
  }
}

}  // namespace
}  // namespace roadfix
