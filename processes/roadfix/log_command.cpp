// roadfix log info|check|cut|filter|repair: what is in a log, and copies of parts of it.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <memory>
#include <regex>

#include "bus/log/log_survey.h"
#include "bus/log/log_writer.h"
#include "bus/types/message.h"
#include "bus/types/type_conversion.h"
#include "roadfix/commands.h"
#include "roadfix/common_options.h"
#include "roadfix/console.h"

namespace roadfix {

namespace {

struct LogArguments {
  std::string in;
  OutputOption out;
  double from_s = 0.0;
  double to_s = 1e9;
  std::vector<std::string> channels;
  bool invert = false;
};

void print_damage(const LogArguments& arguments, const std::vector<LogDamage>& damage) {
  for (const LogDamage& d : damage) {
    say("log", fmt::format("{}: byte {}: {} bytes hold no intact event: {}", arguments.in, d.offset, d.bytes, d.what));
  }
}

void print_info(const LogArguments& arguments) {
  LogReader reader(arguments.in);
  reader.require_events();
  const LogSurvey survey = survey_log(reader);
  std::cout << fmt::format("{}: {} events, {} bytes\n", arguments.in, survey.events, reader.size_bytes());
  std::cout << fmt::format("{:<24} {:<16} {:>9} {:>9} {:>12} {:>9} {:>5}\n", "channel", "type", "events", "rate Hz",
                           "bytes", "span s", "runs");
  for (const auto& [name, channel] : survey.channels) {
    std::cout << fmt::format("{:<24} {:<16} {:>9} {:>9.2f} {:>12} {:>9.2f} {:>5}\n", name, channel.type, channel.events,
                             channel.rate_hz(), channel.bytes,
                             static_cast<double>(channel.last_utime - channel.first_utime) * 1e-6, channel.runs.size());
  }
  if (survey.ours() == 0) std::cout << "no message of a type of Roadfix's: another LCM user's log\n";
  for (const TypeRule& rule : released_rules()) {
    const bool old = std::any_of(survey.channels.begin(), survey.channels.end(),
                                 [&](const auto& c) { return c.second.type == rule.from; });
    if (old)
      std::cout << fmt::format("{} is a type of {}: roadfix log convert makes it {}\n", rule.from, rule.version,
                               rule.to);
  }
  print_damage(arguments, survey.damage);
}

/// Ends with status 1 where anything is broken or missing.
void check_log(const LogArguments& arguments) {
  LogReader reader(arguments.in);
  reader.require_events();
  const LogSurvey survey = survey_log(reader);
  print_damage(arguments, survey.damage);
  bool whole = survey.damage.empty();
  for (const auto& [name, channel] : survey.channels) {
    if (channel.undecodable + channel.missing + channel.misstamped + channel.repeated == 0) continue;
    whole = whole && channel.undecodable + channel.missing + channel.misstamped == 0;
    std::cout << fmt::format("{}: {} undecodable, {} missing by seq, {} stamped against their seq, {} repeated\n", name,
                             channel.undecodable, channel.missing, channel.misstamped, channel.repeated);
  }
  if (survey.backward_stamps > 0) {
    std::cout << fmt::format("{} events are stamped earlier than the one before; harmless\n", survey.backward_stamps);
  }
  std::cout << fmt::format("{}: {} events, {}{}\n", arguments.in, survey.events, whole ? "whole" : "not whole",
                           survey.ours() == 0 ? " as a log, but none of them is a message of Roadfix's" : "");
  if (!whole) throw CLI::RuntimeError(kNotGood);
}

/// Copies the events that `wanted` takes; their stamps stay.
template <class Wanted>
void copy_log(const LogArguments& arguments, const Wanted& wanted) {
  arguments.out.refuse_existing(arguments.in);
  LogReader reader(arguments.in);
  reader.require_events();
  LogWriter writer(arguments.out.path);
  int64_t events = 0;
  while (const std::optional<LogEvent> event = reader.next()) {
    ++events;
    if (wanted(*event)) writer.write(event->channel, event->timestamp_us, event->data);
  }
  const int64_t written = writer.events();
  if (written == 0)
    throw std::runtime_error(arguments.out.path.string() + ": not written: none of the " + std::to_string(events) +
                             " events is wanted");
  writer.commit();
  print_damage(arguments, reader.damage());
  std::cout << fmt::format("{}: {} of {} events\n", arguments.out.path.string(), written, events);
}

/// By the messages' own time, where they have one; in seconds after the earliest.
void cut_log(const LogArguments& arguments) {
  if (!(arguments.from_s < arguments.to_s)) {
    throw std::runtime_error(
        fmt::format("--from-s {} --to-s {}: the stretch ends before it begins; nothing would be left", arguments.from_s,
                    arguments.to_s));
  }
  const auto time_of = [](const LogEvent& event) {
    const std::optional<Header> header = read_header(event.data);
    // A message of another origin has no utime at that place: an hour from its stamp is no utime.
    constexpr int64_t kPlausible_us = 3'600'000'000;
    const bool ours = header && std::abs(header->utime - event.timestamp_us) < kPlausible_us;
    return ours ? header->utime : event.timestamp_us;
  };
  int64_t first_us = std::numeric_limits<int64_t>::max();
  LogReader reader(arguments.in);
  while (const std::optional<LogEvent> event = reader.next()) first_us = std::min(first_us, time_of(*event));
  copy_log(arguments, [&](const LogEvent& event) {
    const double after_s = static_cast<double>(time_of(event) - first_us) * 1e-6;
    return after_s >= arguments.from_s && after_s < arguments.to_s;
  });
}

void filter_log(const LogArguments& arguments) {
  std::vector<std::regex> channels;
  for (const std::string& pattern : arguments.channels) {
    try {
      channels.emplace_back(pattern);
    } catch (const std::regex_error& e) {
      throw std::runtime_error("--channel '" + pattern + "': " + e.what());
    }
  }
  copy_log(arguments, [&](const LogEvent& event) {
    const bool matches = std::any_of(channels.begin(), channels.end(), [&](const std::regex& channel) {
      return std::regex_match(event.channel.begin(), event.channel.end(), channel);
    });
    return matches != arguments.invert;
  });
}

/// Messages of released types that have been replaced become messages of today's; everything else stays as it is.
void convert_log(const LogArguments& arguments) {
  arguments.out.refuse_existing(arguments.in);
  const TypeConverter& converter = TypeConverter::built_in();
  LogReader reader(arguments.in);
  reader.require_events();
  LogWriter writer(arguments.out.path);
  std::map<std::string, int64_t> converted;
  std::vector<uint8_t> bytes;
  while (const std::optional<LogEvent> event = reader.next()) {
    const TypeConverter::Result result = converter(event->data, bytes);
    const bool changed = result == TypeConverter::Result::kConverted;
    writer.write(event->channel, event->timestamp_us, changed ? std::span<const uint8_t>(bytes) : event->data);
    if (changed) ++converted[*converter.old_name(read_int64(event->data.data()))];
    if (result == TypeConverter::Result::kBroken) {
      say("log", fmt::format("{}: byte {}: {}: no message of {}; kept as it is", arguments.in, event->offset,
                             event->channel, *converter.old_name(read_int64(event->data.data()))));
    }
  }
  writer.commit();
  print_damage(arguments, reader.damage());
  for (const auto& [name, count] : converted) std::cout << fmt::format("{}: {} messages\n", name, count);
  std::cout << fmt::format("{}: {} events{}\n", arguments.out.path.string(), writer.events(),
                           converted.empty() ? ", nothing to convert" : "");
}

}  // namespace

void add_log_command(CLI::App& app) {
  const auto arguments = std::make_shared<LogArguments>();
  CLI::App* log = app.add_subcommand("log", "Look at logs, cut, filter, repair and convert them");
  log->require_subcommand(1);
  const auto add = [&](const std::string& name, const std::string& what, bool writes) {
    CLI::App* command = log->add_subcommand(name, what);
    command->add_option("log", arguments->in, "Log")->required()->check(CLI::ExistingFile);
    if (writes) add_output(*command, arguments->out, "Log to write");
    return command;
  };
  add("info", "Channels, types, rates", false)->callback([arguments] { print_info(*arguments); });
  CLI::App* check = add("check", "Damage, broken messages, gaps, stamps that contradict seq", false);
  check->footer("Exit status: 0 the log is whole, 1 it is not, 2 not done: standard error says why.");
  check->callback([arguments] { check_log(*arguments); });
  add("repair", "Copy all intact events", true)->callback([arguments] {
    copy_log(*arguments, [](const LogEvent&) { return true; });
  });
  add("convert", "Copy with messages of earlier versions' types as messages of today's (docs/TYPES.md)", true)
      ->callback([arguments] { convert_log(*arguments); });
  CLI::App* cut = add("cut", "Copy a stretch of time", true);
  cut->add_option("--from-s", arguments->from_s, "Seconds after the first message");
  cut->add_option("--to-s", arguments->to_s, "Seconds after the first message, exclusive");
  cut->callback([arguments] { cut_log(*arguments); });
  CLI::App* filter = add("filter", "Copy some channels", true);
  filter
      ->add_option("--channel,--channels", arguments->channels,
                   "Regular expression over the whole name; again for more")
      ->required()
      ->allow_extra_args(false);
  filter->add_flag("--invert", arguments->invert, "All but these");
  filter->callback([arguments] { filter_log(*arguments); });
}

}  // namespace roadfix
