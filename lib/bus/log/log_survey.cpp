#include "bus/log/log_survey.h"

#include <algorithm>

#include "bus/types/message.h"
#include "bus/types/schema.h"

namespace roadfix {

namespace {

/// The seqs of one run of a channel. Only gaps and repetitions count, not the order in which they came.
using Seqs = std::vector<int64_t>;

constexpr uint64_t kLargestGap = 1'000'000'000;

class Surveyor {
 public:
  explicit Surveyor(LogReader& reader) : reader_(reader) {
    for (const auto& [name, type] : Schema::built_in().types()) {
      types_.emplace(Schema::built_in().fingerprint(name), name);
      checks_.emplace(name, Schema::built_in().check_of(name));
    }
  }

  LogSurvey run() {
    reader_.rewind();
    int64_t last_stamp = 0;
    while (const std::optional<LogEvent> event = reader_.next()) {
      if (survey_.events++ > 0 && event->timestamp_us < last_stamp) ++survey_.backward_stamps;
      last_stamp = event->timestamp_us;
      take(*event);
    }
    survey_.damage = reader_.damage();
    for (auto& [key, seqs] : seqs_) count_gaps(survey_.channels[key.first], seqs);
    return std::move(survey_);
  }

 private:
  void take(const LogEvent& event) {
    const std::string name(event.channel);
    ChannelSurvey& channel = survey_.channels[name];
    if (channel.events++ == 0) channel.type = type_of(event);
    channel.bytes += event.data.size();
    const auto check = checks_.find(channel.type);
    int64_t utime = event.timestamp_us;
    if (check != checks_.end() && event.data.size() >= 32) {  // a part of messages has no header
      if (check->second(event.data) != CheckResult::kOk) {
        ++channel.undecodable;
        return;
      }
      const Header header = *read_header(event.data);
      utime = header.utime;
      channel.runs.insert(header.run);
      seqs_[{name, header.run}].push_back(header.seq);
    }
    channel.first_utime = channel.first_utime == 0 ? utime : std::min(channel.first_utime, utime);
    channel.last_utime = std::max(channel.last_utime, utime);
  }

  std::string type_of(const LogEvent& event) const {
    if (event.data.size() < 8) return "unknown";
    const auto found = types_.find(read_int64(event.data.data()));
    return found == types_.end() ? "unknown" : found->second;
  }

  static void count_gaps(ChannelSurvey& channel, Seqs& seqs) {
    std::sort(seqs.begin(), seqs.end());
    for (std::size_t i = 1; i < seqs.size(); ++i) {
      // Unsigned: a hostile log may hold the extremes. What is larger than any real gap counts as that.
      const uint64_t step = static_cast<uint64_t>(seqs[i]) - static_cast<uint64_t>(seqs[i - 1]);
      if (step == 0) ++channel.repeated;
      if (step > 1) channel.missing += static_cast<int64_t>(std::min<uint64_t>(step - 1, kLargestGap));
    }
  }

  LogReader& reader_;
  std::map<int64_t, std::string> types_;
  std::map<std::string, MessageCheck> checks_;
  std::map<std::pair<std::string, int64_t>, Seqs> seqs_;
  LogSurvey survey_;
};

}  // namespace

double ChannelSurvey::rate_hz() const {
  const int64_t span_us = last_utime - first_utime;
  return span_us > 0 ? static_cast<double>(events - 1) * 1e6 / static_cast<double>(span_us) : 0.0;
}

LogSurvey survey_log(LogReader& reader) { return Surveyor(reader).run(); }

}  // namespace roadfix
