/// What was tried of each source, and when each was last used: what aids the state, and since when it coasts.
#pragma once

#include <algorithm>
#include <array>
#include <initializer_list>
#include <utility>
#include <vector>

#include "navigation/measurement.h"
#include "samples/samples.h"

namespace roadfix::navigation {

class AidingLog {
 public:
  AidingLog() { records_.reserve(1024); }

  /// `id`: the caller's name of the measurement, where the record has none.
  void add(AidingRecord record, int64_t id = 0) {
    if (id != 0) record.id = id;
    if (record.status == AidingStatus::kAccepted || record.status == AidingStatus::kReset) {
      set_used(record.source, record.t_us);
      fresh_ = true;
    }
    if (records_.size() < records_.capacity()) records_.push_back(record);
  }
  /// Used without a record: what the state starts by aids it.
  void set_used(AidingSource source, int64_t t_us) { used_at_us_[static_cast<size_t>(source)] = t_us; }
  /// Something was used since the last call.
  [[nodiscard]] bool take_fresh() { return std::exchange(fresh_, false); }

  /// s from the last use of `source` to t_us.
  [[nodiscard]] double since(AidingSource source, int64_t t_us) const {
    return seconds_between(used_at_us_[static_cast<size_t>(source)], t_us);
  }
  /// When one of these was last used, 0 never.
  [[nodiscard]] int64_t last_use_us(std::initializer_list<AidingSource> sources) const {
    int64_t last = used_at_us_[static_cast<size_t>(*sources.begin())];
    for (const AidingSource s : sources) last = std::max(last, used_at_us_[static_cast<size_t>(s)]);
    return last;
  }
  /// Bit i: source i was used within `time` s before t_us.
  [[nodiscard]] int aided_by(int64_t t_us, double time) const {
    int sources = 0;
    for (size_t i = 0; i < kAidingSources; ++i)
      if (used_at_us_[i] != 0 && seconds_between(used_at_us_[i], t_us) <= time) sources |= 1 << i;
    return sources;
  }

  /// Since the last call to clear_records().
  [[nodiscard]] const std::vector<AidingRecord>& records() const { return records_; }
  void clear_records() { records_.clear(); }
  void keep_records(const AidingLog& other) {
    records_.insert(records_.end(), other.records_.begin(), other.records_.end());
  }

  template <class Archive>
  void serialise(Archive& a) {
    for (int64_t& t : used_at_us_) a(t);
    a(fresh_);
  }

 private:
  std::array<int64_t, kAidingSources> used_at_us_{};
  bool fresh_ = false;
  std::vector<AidingRecord> records_;
};

}  // namespace roadfix::navigation
