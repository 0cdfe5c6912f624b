#include "bus/verify/stage_log.h"

#include <algorithm>
#include <limits>
#include <tuple>

#include "bus/run/stage_runner.h"
#include "bus/types/schema.h"

namespace roadfix {

namespace {

constexpr int64_t kEver = std::numeric_limits<int64_t>::max();
constexpr int64_t kNever = std::numeric_limits<int64_t>::min();

struct Collector {
  const StageSpec& spec;
  const std::vector<LogReader*>& readers;
  const LogIndex& index;
  StageLog log = {};

  /// Calls `take` for each message of a channel that passes the check of its type.
  template <class Take>
  void each(const std::string& channel, const std::string& type, const Take& take) {
    const int number = index.channel(channel);
    if (number < 0) return;
    const MessageCheck check = Schema::built_in().check_of(type);
    for (const IndexedMessage& message : index.messages) {
      if (message.channel != number) continue;
      const LogReader& reader = *readers[static_cast<std::size_t>(message.file)];
      const std::span<const uint8_t> bytes = reader.at(message.offset).data;
      if (const CheckResult result = check(bytes); result != CheckResult::kOk) {
        log.damage.push_back(reader.path().string() + ", byte " + std::to_string(message.offset) + ": " + channel +
                             ": " + to_words(result));
        continue;
      }
      if (is_plausible(message.header)) take(message.header, bytes);
    }
  }

  StageRun& run_of(int64_t run) { return log.runs.try_emplace(run, spec).first->second; }

  void collect() {
    for (int i = 0; i < static_cast<int>(spec.inputs.size()); ++i) {
      const InputSpec& input = spec.inputs[static_cast<std::size_t>(i)];
      each(input.channel, input.type, [&](const Header& header, std::span<const uint8_t> bytes) {
        log.inputs.push_back({i, {header.utime, header.run, header.seq}, bytes});
      });
    }
    std::stable_sort(log.inputs.begin(), log.inputs.end(), [&](const LoggedInput& a, const LoggedInput& b) {
      return std::tuple(a.id.utime, delivery_order(spec, a.input)) <
             std::tuple(b.id.utime, delivery_order(spec, b.input));
    });
    for (int i = 0; i < static_cast<int>(spec.outputs.size()); ++i) {
      const OutputSpec& output = spec.outputs[static_cast<std::size_t>(i)];
      each(output.channel, output.type, [&](const Header& header, std::span<const uint8_t> bytes) {
        run_of(header.run).outputs.push_back({i, header, bytes});
      });
    }
    each(stage_channel("LEDGER_", spec.name), "ledger_t", [&](const Header& header, std::span<const uint8_t> bytes) {
      const auto ledger = decode<ledger_t>(bytes);
      StageRun& run = run_of(header.run);
      run.ledger.add(ledger);
      for (const ledger_entry_t& entry : ledger.entries) run.has_beginning = run.has_beginning || entry.entry == 1;
    });
    each(stage_channel("STATE_", spec.name), "state_t", [&](const Header& header, std::span<const uint8_t> bytes) {
      run_of(header.run).states.push_back(decode<state_t>(bytes));
    });
    for (auto& [run, held] : log.runs) {
      std::stable_sort(held.outputs.begin(), held.outputs.end(), [](const RecordedOutput& a, const RecordedOutput& b) {
        return std::tie(a.header.utime, a.output, a.header.seq) < std::tie(b.header.utime, b.output, b.header.seq);
      });
    }
  }
};

/// The parts of first..last that the ledger does not exclude.
void add_losses(const LedgerRecord& ledger, LogLoss loss, std::vector<LogLoss>& losses) {
  constexpr int64_t kCountedOneByOne = 1'000'000;
  if (loss.last_seq - loss.first_seq > kCountedOneByOne) {
    losses.push_back(loss);
    return;
  }
  const int64_t last = loss.last_seq;
  for (int64_t seq = loss.first_seq; seq <= last; ++seq) {
    if (ledger.excludes(loss.input, {loss.before_utime, loss.run, seq})) continue;
    if (!losses.empty() && losses.back().input == loss.input && losses.back().run == loss.run &&
        losses.back().last_seq + 1 == seq) {
      losses.back().last_seq = seq;
      continue;
    }
    loss.first_seq = seq;
    loss.last_seq = seq;
    losses.push_back(loss);
  }
}

/// Messages of one run of one channel, by seq.
using Sequence = std::map<int64_t, int64_t>;  // seq to utime

void find_in_sequence(const StageRun& run, int input, int64_t input_run, const Sequence& sequence, bool oldest_run,
                      std::vector<LogLoss>& losses) {
  const std::optional<int64_t> began = run.ledger.began_at(input, input_run);
  if (!began && (run.has_beginning || !oldest_run)) return;  // the stage took nothing of it
  const auto [first_seq, first_utime] = *sequence.begin();
  if (began && *began < first_seq) {
    add_losses(run.ledger, {input, input_run, *began, first_seq - 1, kNever, first_utime}, losses);
  } else if (!began) {
    // The recording began in mid-drive: whatever came before may have been used.
    losses.push_back({input, input_run, kNever, first_seq - 1, kNever, first_utime});
  }
  for (auto previous = sequence.begin(), next = std::next(previous); next != sequence.end(); ++previous, ++next) {
    if (next->first == previous->first + 1 || (began && next->first <= *began)) continue;
    add_losses(run.ledger, {input, input_run, previous->first + 1, next->first - 1, previous->second, next->second},
               losses);
  }
}

/// Where the stamps went back under a driver that went on, its later numbers lie among the stamps of a run of the stage
/// that had ended. Lost ones behind the last that this run took are none of its own.
void exclude_later(const StageSpec& spec, const StageLog& log, const StageRun& run, const provenance_t& provenance,
                   std::vector<LogLoss>& losses) {
  std::map<int, int64_t> last_taken;
  for (std::size_t i = 0; i < spec.inputs.size() && i < provenance.last_seq.size(); ++i) {
    last_taken[static_cast<int>(i)] = provenance.last_seq[i];
  }
  for (const ClockSpec& clock : spec.clocks) last_taken.erase(clock.input);  // a sample acts before it is applied
  for (const LoggedInput& logged : log.inputs) {
    const bool is_last_tick = logged.id.utime == run.outputs.back().header.utime &&
                              logged.id.run == run.ledger.newest_run(logged.input) &&
                              delivery_order(spec, logged.input) > 0;
    if (is_last_tick) last_taken[logged.input] = std::max(last_taken[logged.input], logged.id.seq);
  }
  std::erase_if(losses, [&](const LogLoss& loss) {
    const auto last = last_taken.find(loss.input);
    return last != last_taken.end() && last->second >= 0 && loss.run == run.ledger.newest_run(loss.input) &&
           loss.first_seq > last->second;
  });
}

}  // namespace

StageLog collect_stage_log(const StageSpec& spec, const std::vector<LogReader*>& readers, const LogIndex& index) {
  Collector collector{spec, readers, index};
  collector.collect();
  return std::move(collector.log);
}

std::optional<provenance_t> read_provenance(const std::string& type, std::span<const uint8_t> bytes) {
  const std::vector<SchemaField>& fields = Schema::built_in().type(type).fields;
  if (fields.size() < 4 || fields[3].type != "provenance_t") return std::nullopt;
  constexpr int kBehindHeader = 32;
  provenance_t provenance;
  if (provenance._decodeNoHash(bytes.data(), kBehindHeader, static_cast<int>(bytes.size()) - kBehindHeader) < 0) {
    return std::nullopt;
  }
  return provenance;
}

std::vector<LogLoss> find_losses(const StageSpec& spec, const StageLog& log, const StageRun& run) {
  std::vector<std::map<int64_t, Sequence>> sequences(spec.inputs.size());
  for (const LoggedInput& logged : log.inputs) {
    sequences[static_cast<std::size_t>(logged.input)][logged.id.run].emplace(logged.id.seq, logged.id.utime);
  }
  std::vector<LogLoss> losses;
  for (std::size_t i = 0; i < sequences.size(); ++i) {
    for (const auto& [input_run, sequence] : sequences[i]) {
      const bool oldest = input_run == sequences[i].begin()->first;
      find_in_sequence(run, static_cast<int>(i), input_run, sequence, oldest, losses);
    }
  }
  if (run.outputs.empty()) return losses;
  // The end of a channel: what the last output had applied, but the log has not.
  const RecordedOutput& last = run.outputs.back();
  const std::string& type = spec.outputs[static_cast<std::size_t>(last.output)].type;
  const std::optional<provenance_t> provenance = read_provenance(type, last.bytes);
  if (provenance) exclude_later(spec, log, run, *provenance, losses);
  for (std::size_t i = 0; provenance && i < sequences.size() && i < provenance->last_seq.size(); ++i) {
    if (provenance->last_seq[i] < 0) continue;
    const int input = static_cast<int>(i);
    if (sequences[i].empty()) {
      losses.push_back({input, 0, kNever, kEver, kNever, kEver});
      continue;
    }
    const auto& [input_run, sequence] = *sequences[i].rbegin();
    const auto [last_seq, last_utime] = *sequence.rbegin();
    if (last_utime <= last.header.utime && last_seq < provenance->last_seq[i]) {
      losses.push_back({input, input_run, last_seq + 1, provenance->last_seq[i], last_utime, kEver});
    }
  }
  return losses;
}

}  // namespace roadfix
