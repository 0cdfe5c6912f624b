#include "bus/log/log_survey.h"

#include <algorithm>
#include <tuple>

#include "bus/log/stray_stamps.h"
#include "bus/types/message.h"
#include "bus/types/schema.h"

namespace roadfix {

namespace {

constexpr const char* kUnknown = "unknown";
constexpr std::size_t kNamed = 5;  // channels of a log that is not ours
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
    for (auto& [name, stamps] : stamps_) take_stamps(survey_.channels[name], stamps);
    return std::move(survey_);
  }

 private:
  void take(const LogEvent& event) {
    const std::string name(event.channel);
    ChannelSurvey& channel = survey_.channels[name];
    if (channel.events++ == 0) channel.type = type_of(event);
    channel.bytes += event.data.size();
    const auto check = checks_.find(channel.type);
    if (check != checks_.end() && event.data.size() >= 32) {  // a part of messages has no header
      if (check->second(event.data) != CheckResult::kOk) {
        ++channel.undecodable;
        return;
      }
      const Header header = *read_header(event.data);
      channel.runs.insert(header.run);
      stamps_[name].push_back({header.run, header.seq, header.utime});
    } else {
      take_time(channel, event.timestamp_us);
    }
  }

  static void take_time(ChannelSurvey& channel, int64_t utime) {
    channel.first_utime = channel.first_utime == 0 ? utime : std::min(channel.first_utime, utime);
    channel.last_utime = std::max(channel.last_utime, utime);
  }

  std::string type_of(const LogEvent& event) const {
    if (event.data.size() < 8) return kUnknown;
    const auto found = types_.find(read_int64(event.data.data()));
    return found == types_.end() ? kUnknown : found->second;
  }

  static void take_stamps(ChannelSurvey& channel, std::vector<Stamp>& stamps) {
    const std::vector<StampError> errors = stamp_errors(stamps);
    channel.misstamped =
        std::count_if(errors.begin(), errors.end(), [](StampError e) { return e != StampError::kNone; });
    const std::vector<StampError> stray = stray_stamps(stamps);
    for (std::size_t i = 0; i < stamps.size(); ++i) {
      if (stray[i] == StampError::kNone) take_time(channel, stamps[i].utime);
    }
    count_gaps(channel, stamps);
  }

  /// Only gaps and repetitions count, not the order in which the messages came.
  static void count_gaps(ChannelSurvey& channel, std::vector<Stamp>& stamps) {
    std::sort(stamps.begin(), stamps.end(),
              [](const Stamp& a, const Stamp& b) { return std::tie(a.run, a.seq) < std::tie(b.run, b.seq); });
    for (std::size_t i = 1; i < stamps.size(); ++i) {
      if (stamps[i].run != stamps[i - 1].run) continue;
      // Unsigned: a hostile log may hold the extremes. What is larger than any real gap counts as that.
      const uint64_t step = static_cast<uint64_t>(stamps[i].seq) - static_cast<uint64_t>(stamps[i - 1].seq);
      if (step == 0) ++channel.repeated;
      if (step > 1) channel.missing += static_cast<int64_t>(std::min<uint64_t>(step - 1, kLargestGap));
    }
  }

  LogReader& reader_;
  std::map<int64_t, std::string> types_;
  std::map<std::string, MessageCheck> checks_;
  std::map<std::string, std::vector<Stamp>> stamps_;
  LogSurvey survey_;
};

}  // namespace

double ChannelSurvey::rate_hz() const {
  const double span_us = static_cast<double>(last_utime) - static_cast<double>(first_utime);
  return span_us > 0.0 ? static_cast<double>(events - 1) * 1e6 / span_us : 0.0;
}

int64_t LogSurvey::ours() const {
  int64_t count = 0;
  for (const auto& [name, channel] : channels) count += channel.type != kUnknown ? channel.events : 0;
  return count;
}

LogSurvey survey_log(LogReader& reader) { return Surveyor(reader).run(); }

void require_our_log(LogReader& reader) {
  reader.require_events();
  std::set<int64_t> ours;
  for (const auto& [name, type] : Schema::built_in().types()) ours.insert(Schema::built_in().fingerprint(name));
  std::set<std::string, std::less<>> channels;
  while (const std::optional<LogEvent> event = reader.next()) {
    if (event->data.size() >= 8 && ours.contains(read_int64(event->data.data()))) return reader.rewind();
    if (channels.size() < kNamed + 1 && !channels.contains(event->channel)) channels.emplace(event->channel);
  }
  std::string text = reader.path().string() + ": an LCM log, but no message of a type of Roadfix's is in it: ";
  std::size_t named = 0;
  for (const std::string& channel : channels) {
    text += (named == 0 ? "" : ", ") + (named < kNamed ? channel : std::string("..."));
    ++named;
  }
  throw LogError(text);
}

}  // namespace roadfix
