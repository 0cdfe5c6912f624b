/// A whole run as a text table, one line of JSON a task, and one page that needs nothing but a browser.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "roadfix/fleet/protection_pool.h"
#include "roadfix/fleet/run_folder.h"
#include "statistics/summary.h"

namespace roadfix {

/// One channel over all drives that ended well.
struct FleetChannel {
  std::size_t drives = 0;
  std::vector<double> horizontal, p95, vertical, yaw;  ///< RMSE of each drive, m and deg; what was scored
  std::vector<double> nees, within_3sigma, available;  ///< of each drive
  std::vector<double> outage_m, outage_percent;        ///< of every outage of every drive, at its end
  int missing_outages = 0;
  ProtectionPool protection;  ///< of levels published for it
  std::string bound;          ///< what the horizontal errors are held against where there are none
  std::map<std::pair<int, int>, int64_t> cells;
  int64_t samples = 0, exceeded = 0;
};

struct FleetSummary {
  std::map<std::string, FleetChannel> channels;
  nlohmann::ordered_json tasks = nlohmann::ordered_json::array();  ///< what the page shows of each
  std::size_t ok = 0, failed = 0, missing = 0;
  double drive_s = 0.0, cpu_s = 0.0, wall_s = 0.0;
  double max_rss_mb = 0.0;
  std::map<std::string, std::size_t> builds;  ///< of the results
};

/// Reads every result once and writes it to RUN/results.jsonl on the way.
FleetSummary summarise_run(const RunFolder& run);

std::string fleet_table(const RunFolder& run, const FleetSummary& summary);
std::string fleet_page(const RunFolder& run, const FleetPlan& plan, const FleetSummary& summary);

}  // namespace roadfix
