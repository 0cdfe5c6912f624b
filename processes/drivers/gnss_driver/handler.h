/// GNSS from a receiver's NMEA and UBX: the bytes of RAW_GNSS to gnss_t.
#pragma once

#include <filesystem>

#include "drivers/device/driver.h"
#include "drivers/gnss_driver/gnss_epochs.h"
#include "drivers/protocols/device_clock.h"
#include "drivers/protocols/framer.h"
#include "drivers/protocols/nmea.h"
#include "drivers/protocols/ubx.h"

namespace roadfix {

/// Where a fix's utime comes from.
enum class GnssTime {
  kMapped,  ///< the receiver's time on the computer's time line, by the filtered offset: right whatever the computer's
            ///< clock shows, but late by the least delay of the path, which `latency` takes off
  kUtc      ///< the receiver's UTC itself: for a computer whose clock follows GNSS (chrony with PPS)
};

/// Standard deviations of a position for one unit of HDOP, m, where the receiver sends no GST.
struct NmeaSigmas {
  double single = 3.0;  ///< user range error without corrections; multipath of a road included
  double differential = 1.0;
  double rtk_float = 0.4;
  double rtk_fixed = 0.02;
  double vertical_ratio = 2.0;  ///< vertical to horizontal
  double velocity = 0.2;        ///< m/s, of the horizontal velocity
};

/// The corrections' caster.
struct NtripConfig {
  std::string host;
  int port = 2101;
  std::string mountpoint;
  std::string user;
  std::string password_file;    ///< first line; a password has no place in a configuration that is recorded
  double send_position = 10.0;  ///< s between two GGA sentences to the caster; 0: none
};

struct GnssDriverConfig {
  DeviceConfig device;
  std::string channel = "GNSS";
  GnssTime time = GnssTime::kMapped;
  double latency = 0.0;          ///< s, from the time of validity to the first byte, of kMapped
  double max_clock_error = 0.5;  ///< s, of kUtc: a fix further from the computer's clock is refused
  bool moving_base = false;      ///< NAV-RELPOSNED is the vector between two antennas of this vehicle
  double baseline_heading_deg =
      0.0;                       ///< direction of that vector in the vehicle, clockwise from its x axis; for HDT too
  double heading_std_deg = 0.5;  ///< of HDT and THS, which say none
  NmeaSigmas nmea;
  std::optional<NtripConfig> ntrip;
};

template <class Visitor>
void visit(NmeaSigmas& c, Visitor& v) {
  v.number("single_m", c.single, 1e-3, 1e3);
  v.number("differential_m", c.differential, 1e-3, 1e3);
  v.number("rtk_float_m", c.rtk_float, 1e-3, 1e3);
  v.number("rtk_fixed_m", c.rtk_fixed, 1e-3, 1e3);
  v.number("vertical_ratio", c.vertical_ratio, 0.1, 100.0);
  v.number("velocity_mps", c.velocity, 1e-3, 100.0);
}

template <class Visitor>
void visit(NtripConfig& c, Visitor& v) {
  v.require("host");
  v.require("mountpoint");
  v.text("host", c.host);
  v.integer("port", c.port, 1, 65535);
  v.text("mountpoint", c.mountpoint);
  v.text("user", c.user);
  v.text("password_file", c.password_file);
  v.number("send_position_s", c.send_position, 0.0, 3600.0);
}

template <class Visitor>
void visit(GnssDriverConfig& c, Visitor& v) {
  visit(c.device, v);
  v.text("channel", c.channel);
  v.choice("time", c.time, {{"mapped", GnssTime::kMapped}, {"utc", GnssTime::kUtc}});
  v.number("latency_s", c.latency, 0.0, 2.0);
  v.number("max_clock_error_s", c.max_clock_error, 1e-3, 10.0);
  v.boolean("moving_base", c.moving_base);
  v.number("baseline_heading_deg", c.baseline_heading_deg, -360.0, 360.0);
  v.number("heading_std_deg", c.heading_std_deg, 1e-3, 180.0);
  v.group("nmea_std", c.nmea);
  v.optional_group("ntrip", c.ntrip);
}

class GnssDriver : public SensorDriver {
 public:
  explicit GnssDriver(const GnssDriverConfig& config);

  void opened(int stream) override;
  void take(int stream, int64_t read_utime, std::span<const uint8_t> bytes, SensorOutputs& outputs) override;
  [[nodiscard]] std::vector<StreamCounters> counters() const override;

  /// The last position, as a GGA sentence for a caster; absent before the first.
  [[nodiscard]] std::optional<std::string> position_for_caster(int64_t now_utime) const;

 private:
  struct SentenceCounts {
    int64_t used = 0;
    int64_t refused = 0;
  };
  enum Protocol { kUbx = 0, kNmea = 1, kRtcm = 2 };

  void take_ubx(std::span<const uint8_t> frame, int64_t read_utime);
  void take_pvt(const UbxNavPvt& pvt, int64_t read_utime);
  void take_relposned(const UbxNavRelPosNed& r, int64_t read_utime);
  void take_nmea(std::span<const uint8_t> frame, int64_t read_utime);
  void take_gga(const NmeaGga& gga, int64_t read_utime);
  void take_motion(const NmeaMotion& motion, int64_t read_utime);
  void take_gst(const NmeaGst& gst, int64_t read_utime);
  void take_heading(double heading_deg, int64_t read_utime);
  void set_heading(double heading_deg, double std_deg, GnssFix& fix) const;
  [[nodiscard]] std::optional<int64_t> utime_of(int64_t utc, int64_t read_utime);
  void publish(SensorOutputs& outputs);

  GnssDriverConfig config_;
  Framer framer_;
  DeviceClock clock_;
  GnssEpochs epochs_;
  std::optional<int64_t> ubx_seen_us_;  ///< when the last NAV-PVT came: NMEA beside it says the same again
  std::optional<double> pdop_;
  SentenceCounts ubx_, nmea_;
  int64_t published_ = 0, late_ = 0, newest_utime_ = 0;
  std::optional<Geodetic> last_position_;
};

/// VEHICLE/gnss_driver.yaml; `device` replaces its device where it is not empty.
DriverSetup gnss_driver_setup(const std::filesystem::path& vehicle_dir, const std::string& device);
DriverSetup gnss_driver_setup(const GnssDriverConfig& config);

}  // namespace roadfix
