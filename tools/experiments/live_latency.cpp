// How long the live stack takes, from what our recorder wrote: live_latency LOG... Prints two lines of JSON's numbers:
//   imu_to_ins_p50_us        from the arrival of an IMU sample to that of the POSE_INS of its stamp (kernel stamps,
//   both at the recorder) camera_to_fused_p99_ms   from the arrival of a picture to the first POSE_FUSED whose
//   provenance has applied its POSE_VO
// and the same over the first and the last quarter of the time (imu_to_ins_first_us, ..._last_us).
#include <algorithm>
#include <iostream>
#include <map>
#include <roadfix/pose_t.hpp>
#include <vector>

#include "bus/log/log_reader.h"
#include "bus/types/message.h"
#include "bus/types/schema.h"

namespace {

using namespace roadfix;

constexpr std::size_t kPoseVo = 3;  // of imm_fusion's inputs
constexpr std::size_t kFusionInputs = 6;

double percentile(std::vector<int64_t> values, double share) {
  if (values.empty()) return -1.0;
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return static_cast<double>(*nth);
}

struct Latencies {
  std::map<int64_t, int64_t> imu_at, picture_at;  // by utime
  std::map<int64_t, int64_t> vo_picture_at;       // by seq of POSE_VO: arrival of its picture
  std::vector<int64_t> imu_us, camera_us;
  std::vector<int64_t> tracker_us;   // from the picture's arrival to that of its POSE_VO
  std::vector<int64_t> lateness_us;  // of POSE_VO, behind the newest POSE_INS there
  int64_t newest_ins_utime = 0;

  void take(const LogEvent& event, const MessageCheck& is_pose) {
    const std::optional<Header> header = read_header(event.data);
    if (!header) return;
    if (event.channel == "IMU") imu_at[header->utime] = event.timestamp_us;
    if (event.channel == "CAMERA_LEFT") picture_at[header->utime] = event.timestamp_us;
    if (event.channel == "POSE_INS") {
      const auto imu = imu_at.find(header->utime);
      if (imu != imu_at.end()) imu_us.push_back(event.timestamp_us - imu->second);
      imu_at.erase(imu_at.begin(), imu_at.upper_bound(header->utime));
      newest_ins_utime = std::max(newest_ins_utime, header->utime);
    }
    if (event.channel == "POSE_VO") {
      const auto picture = picture_at.find(header->utime);
      if (picture != picture_at.end()) {
        vo_picture_at[header->seq] = picture->second;
        tracker_us.push_back(event.timestamp_us - picture->second);
        lateness_us.push_back(newest_ins_utime - header->utime);
      }
      picture_at.erase(picture_at.begin(), picture_at.upper_bound(header->utime));
    }
    if (event.channel != "POSE_FUSED" || is_pose(event.data) != CheckResult::kOk) return;
    const pose_t pose = decode<pose_t>(event.data);
    if (pose.provenance.last_seq.size() != kFusionInputs) return;
    const int64_t applied = pose.provenance.last_seq[kPoseVo];
    while (!vo_picture_at.empty() && vo_picture_at.begin()->first <= applied) {
      camera_us.push_back(event.timestamp_us - vo_picture_at.begin()->second);
      vo_picture_at.erase(vo_picture_at.begin());
    }
  }
};

}  // namespace

int main(int argc, char** argv) {
  Latencies latencies;
  const MessageCheck is_pose = Schema::built_in().check_of("pose_t");
  for (int i = 1; i < argc; ++i) {
    LogReader reader(argv[i]);
    while (const std::optional<LogEvent> event = reader.next()) latencies.take(*event, is_pose);
  }
  const std::vector<int64_t>& imu = latencies.imu_us;
  const auto quarter = static_cast<std::ptrdiff_t>(imu.size() / 4);
  std::cout << "{\"imu_to_ins_p50_us\": " << percentile(imu, 0.5)
            << ", \"imu_to_ins_p99_us\": " << percentile(imu, 0.99)
            << ", \"imu_to_ins_first_us\": " << percentile({imu.begin(), imu.begin() + quarter}, 0.5)
            << ", \"imu_to_ins_last_us\": " << percentile({imu.end() - quarter, imu.end()}, 0.5)
            << ", \"imu_samples\": " << imu.size()
            << ", \"camera_to_fused_p50_ms\": " << percentile(latencies.camera_us, 0.5) * 1e-3
            << ", \"camera_to_fused_p99_ms\": " << percentile(latencies.camera_us, 0.99) * 1e-3
            << ", \"tracker_p50_ms\": " << percentile(latencies.tracker_us, 0.5) * 1e-3
            << ", \"tracker_p99_ms\": " << percentile(latencies.tracker_us, 0.99) * 1e-3
            << ", \"vo_lateness_p50_ms\": " << percentile(latencies.lateness_us, 0.5) * 1e-3
            << ", \"vo_lateness_p99_ms\": " << percentile(latencies.lateness_us, 0.99) * 1e-3
            << ", \"vo_lateness_max_ms\": " << percentile(latencies.lateness_us, 1.0) * 1e-3
            << ", \"pictures\": " << latencies.camera_us.size() << "}\n";
  return latencies.imu_us.empty() ? 1 : 0;
}
