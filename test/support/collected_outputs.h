/// Keeps what a stage publishes, for tests of handlers without a runner.
#pragma once

#include "bus/stage.h"

namespace roadfix::test {

class CollectedOutputs : public Outputs {
 public:
  struct Published {
    int output;
    std::vector<uint8_t> bytes;
  };

  int64_t now_utime = 0;
  std::vector<Published> sent;

  /// The messages of one output, decoded.
  template <class T>
  std::vector<T> of(int output) const {
    std::vector<T> messages;
    for (const Published& s : sent) {
      if (s.output == output) messages.push_back(decode<T>(s.bytes));
    }
    return messages;
  }

 protected:
  Header stamp(int output) override { return {now_utime, 1, seq_[output]++}; }
  const provenance_t& provenance() override { return provenance_; }
  void send(int output, const char*, std::span<const uint8_t> bytes) override {
    sent.push_back({output, {bytes.begin(), bytes.end()}});
  }

 private:
  provenance_t provenance_{};
  std::map<int, int64_t> seq_;
};

}  // namespace roadfix::test
