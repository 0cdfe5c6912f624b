#include "roadfix/doctor/doctor.h"

#include <catch2/catch.hpp>
#include <fstream>
#include <sstream>

namespace roadfix {
namespace {

namespace fs = std::filesystem;

/// A made /proc, removed at the end.
class MadeRoot {
 public:
  MadeRoot() : root_(fs::temp_directory_path() / ("roadfix_doctor_" + std::to_string(::getpid()))) {
    fs::create_directories(root_);
  }
  ~MadeRoot() { fs::remove_all(root_); }
  MadeRoot(const MadeRoot&) = delete;
  MadeRoot& operator=(const MadeRoot&) = delete;
  void write(const std::string& file, const std::string& text) const {
    fs::create_directories((root_ / file).parent_path());
    std::ofstream(root_ / file) << text;
  }
  [[nodiscard]] const fs::path& path() const { return root_; }

 private:
  fs::path root_;
};

const std::string kHeading = "Iface\tDestination\tGateway\tFlags\tRefCnt\tUse\tMetric\tMask\tMTU\tWindow\tIRTT\n";
const std::string kDefaultRoute = "eth0\t00000000\t0101A8C0\t0003\t0\t0\t0\t00000000\t0\t0\t0\n";
const std::string kMulticastLo = "lo\t000000E0\t00000000\t0001\t0\t0\t0\t000000F0\t0\t0\t0\n";

TEST_CASE("a bus URL is taken apart and a wrong one names its part") {
  CHECK(parse_bus_url("udpm://").ttl == 0);
  const BusUrl url = parse_bus_url("udpm://239.1.2.3:7700?recv_buf_size=2097152&ttl=1");
  CHECK(url.group == "239.1.2.3");
  CHECK(url.port == 7700);
  CHECK(url.ttl == 1);
  CHECK_THROWS_WITH(parse_bus_url("udpm://10.0.0.1:7667"), Catch::Contains("no multicast address"));
  CHECK_THROWS_WITH(parse_bus_url("udpm://239.1.2.3:x"), Catch::Contains("port"));
  CHECK_THROWS_WITH(parse_bus_url("tcpq://"), Catch::Contains("udpm"));
}

TEST_CASE("the route is the most exact one, and what is wrong has a mend") {
  const MadeRoot root;
  const BusUrl local;
  BusUrl network;
  network.ttl = 1;
  root.write("proc/net/route", kHeading);
  CHECK(check_route(root.path(), local).level == Level::kError);
  CHECK(check_route(root.path(), local).mend.find("dev lo") != std::string::npos);
  root.write("proc/net/route", kHeading + kDefaultRoute);
  CHECK(check_route(root.path(), local).level == Level::kWarning);
  CHECK(check_route(root.path(), network).level == Level::kOk);
  root.write("proc/net/route", kHeading + kDefaultRoute + kMulticastLo);
  CHECK(check_route(root.path(), local).level == Level::kOk);
  CHECK(check_route(root.path(), network).level == Level::kError);
}

TEST_CASE("small buffers are found and named by their sysctl") {
  const MadeRoot root;
  root.write("proc/sys/net/core/rmem_max", "4194304\n");
  root.write("proc/sys/net/core/rmem_default", "212992\n");
  const std::vector<Finding> findings = check_buffers(root.path());
  REQUIRE(findings.size() == 2);
  CHECK(findings[0].level == Level::kOk);
  CHECK(findings[1].level == Level::kWarning);
  CHECK(findings[1].mend == "sysctl -w net.core.rmem_default=4194304");
}

TEST_CASE("reassembly matters only between hosts") {
  const MadeRoot root;
  root.write("proc/sys/net/ipv4/ipfrag_high_thresh", "4194304\n");
  root.write("proc/sys/net/ipv4/ipfrag_time", "30\n");
  BusUrl url;
  CHECK(check_reassembly(root.path(), url).empty());
  url.ttl = 1;
  CHECK(check_reassembly(root.path(), url).size() == 2);
}

TEST_CASE("what lcm-spy misses is named, and one command brings it") {
  const MadeRoot root;
  const auto look = [&root] { return check_spy("/bin:/usr/bin", root.path(), root.path() / "types.jar"); };
  root.write("usr/bin/java", "");
  root.write("usr/bin/lcm-spy", "");
  root.write("usr/share/java/lcm.jar", "");
  std::vector<Finding> findings = look();
  REQUIRE(findings.size() == 3);
  CHECK(findings[0].seen.find("a Java with windows") != std::string::npos);
  CHECK(findings[1].seen.find("jchart2d.jar is missing") != std::string::npos);
  CHECK(findings[2].seen.find("roadfix_types.jar") != std::string::npos);
  for (const Finding& finding : findings) CHECK(finding.mend == "scripts/spy --prepare");
  root.write("usr/lib/jvm/java-17/lib/libawt_xawt.so", "");
  root.write("usr/share/java/jchart2d.jar", "");
  root.write("types.jar", "");
  for (const Finding& finding : look()) CHECK(finding.level == Level::kOk);
}

TEST_CASE("whatever is wrong, what mends it is said, or what is to be decided") {
  const MadeRoot root;
  root.write("proc/net/route", kHeading);
  root.write("proc/sys/net/ipv4/ipfrag_time", "30\n");
  BusUrl url;
  url.ttl = 1;
  std::vector<Finding> all = {check_route(root.path(), url), check_ttl(url), check_disk("/", UINT64_MAX),
                              check_disk("/no/such/folder", 1), check_clock()};
  for (const std::vector<Finding>& more : {check_buffers(root.path()), check_reassembly(root.path(), url),
                                           check_spy("/bin", root.path(), root.path() / "types.jar")})
    all.insert(all.end(), more.begin(), more.end());
  CHECK(std::count_if(all.begin(), all.end(), [](const Finding& f) { return f.level != Level::kOk; }) >= 11);
  for (const Finding& finding : all) {
    CAPTURE(finding.check, finding.seen);
    CHECK((finding.level == Level::kOk) == (finding.mend.empty() && finding.advice.empty()));
  }
}

TEST_CASE("the disk check compares with what a drive wants") {
  CHECK(check_disk("/", 1).level == Level::kOk);
  CHECK(check_disk("/", UINT64_MAX).level == Level::kWarning);
  CHECK(check_disk("/no/such/folder", 1).level == Level::kError);
}

TEST_CASE("real time: root may, others as far as their limits go") {
  CHECK(check_realtime(true, 0, 0).level == Level::kOk);
  CHECK(check_realtime(false, 0, UINT64_MAX).level == Level::kWarning);
  CHECK(check_realtime(false, 0, UINT64_MAX).mend.find("rtprio") != std::string::npos);
  CHECK(check_realtime(false, 60, 65536).seen.find("64 KiB") != std::string::npos);
  CHECK(check_realtime(false, 60, UINT64_MAX).level == Level::kOk);
}

TEST_CASE("settings and services: not there, installed only, enabled") {
  const MadeRoot root;
  CHECK(check_services(root.path())[0].level == Level::kWarning);
  CHECK(check_services(root.path())[1].level == Level::kOk);  // a desk needs none
  root.write("etc/sysctl.d/60-roadfix.conf", "net.core.rmem_max = 8388608\n");
  root.write("etc/systemd/system/roadfix.target", "");
  CHECK(check_services(root.path())[0].level == Level::kOk);
  CHECK(check_services(root.path())[1].level == Level::kWarning);
  root.write("etc/systemd/system/roadfix.target.wants/roadfix@recorder.service", "");
  CHECK(check_services(root.path())[1].seen == "1 start with the machine");
}

TEST_CASE("devices: what is there and may be opened") {
  const MadeRoot root;
  CHECK(check_devices(root.path()).empty());
  root.write("dev/ttyACM0", "");
  root.write("dev/null0", "");
  const std::vector<Finding> findings = check_devices(root.path());
  REQUIRE(findings.size() == 1);
  CHECK(findings[0].level == Level::kOk);
  CHECK(findings[0].seen == "/dev/ttyACM0");
}

TEST_CASE("the worst finding comes last and is returned") {
  std::ostringstream out;
  CHECK(print_findings({{Level::kError, "b", "bad", "mend it"}, {Level::kOk, "a", "fine", ""}}, out) == Level::kError);
  CHECK(out.str().find("fine") < out.str().find("bad"));
  CHECK(out.str().find("mend: mend it") != std::string::npos);
}

}  // namespace
}  // namespace roadfix
