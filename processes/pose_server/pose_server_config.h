/// configs/VEHICLE/pose_server.yaml: which pose goes out, as what, where to and how often.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <string>
#include <vector>

namespace roadfix {

/// Hz; 0: never. A sentence comes with the first pose of each period, counted from full seconds of UTC.
struct SentenceRates {
  double gga = 5.0, rmc = 5.0, vtg = 5.0, hdt = 5.0, gst = 1.0, zda = 1.0;
};

struct PoseServerConfig {
  std::string pose_channel = "POSE_FUSED";
  std::string gnss_channel = "GNSS";          ///< type of fix, satellites; aiding holds whose position was used
  std::string aiding_channel = "AIDING_INS";  ///< which fixes were accepted
  std::string talker = "GN";                  ///< IN: integrated navigation
  SentenceRates rates;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< m, vehicle axes from the pose's origin: the point that is sent
  double fix_age = 2.0;                             ///< s without an accepted fix after which a pose is dead reckoning
  double silence = 0.5;  ///< s without a pose after which sentences say that there is no position
  /// "auto": the finest of GeographicLib's geoids that is installed; "none"; or one's name, for example egm96-5.
  std::string geoid = "auto";
  std::string geoid_path;               ///< folder; empty: GeographicLib's own
  std::string tcp = "127.0.0.1:10110";  ///< listens there; empty: not (10110: NMEA 0183's port by IANA)
  std::vector<std::string> udp;         ///< address:port of each receiver
  std::string serial;                   ///< "/dev/ttyUSB0", "pty:", or empty
  int baud = 115200;
  int clients = 16;        ///< of TCP, at once
  double patience = 10.0;  ///< s in which a client takes nothing at all, after which it is let go
};

template <class Visitor>
void visit(SentenceRates& c, Visitor& v) {
  v.number("gga_hz", c.gga, 0.0, 200.0);
  v.number("rmc_hz", c.rmc, 0.0, 200.0);
  v.number("vtg_hz", c.vtg, 0.0, 200.0);
  v.number("hdt_hz", c.hdt, 0.0, 200.0);
  v.number("gst_hz", c.gst, 0.0, 200.0);
  v.number("zda_hz", c.zda, 0.0, 200.0);
}

template <class Visitor>
void visit(PoseServerConfig& c, Visitor& v) {
  v.text("pose_channel", c.pose_channel);
  v.text("gnss_channel", c.gnss_channel);
  v.text("aiding_channel", c.aiding_channel);
  v.text("talker", c.talker);
  v.check("talker",
          c.talker.size() == 2 &&
              std::all_of(c.talker.begin(), c.talker.end(), [](char l) { return l >= 'A' && l <= 'Z'; }),
          "two capital letters, GN or IN for example");
  v.group("rates", c.rates);
  v.vector("point_m", c.point, -100.0, 100.0);
  v.number("fix_age_s", c.fix_age, 0.05, 60.0);
  v.number("silence_s", c.silence, 0.05, 60.0);
  v.text("geoid", c.geoid);
  v.text("geoid_path", c.geoid_path);
  v.text("tcp", c.tcp);
  v.texts("udp", c.udp);
  v.text("serial", c.serial);
  v.integer("baud", c.baud, 1200, 4'000'000);
  v.integer("clients", c.clients, 1, 256);
  v.number("patience_s", c.patience, 0.1, 3600.0);
}

}  // namespace roadfix
