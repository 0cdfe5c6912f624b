#include "drivers/device/driver.h"

namespace roadfix {

void RawReader::take(int stream, const Header& header, std::span<const uint8_t> bytes) {
  if (!driver_ || header.run != run_) {
    run_ = header.run;
    driver_ = setup_.make();
    next_seq_.clear();
    outputs_.begin(run_);
  }
  const auto expected = next_seq_.find(stream);
  const bool continues = expected != next_seq_.end() && header.seq == expected->second;
  if (expected != next_seq_.end() && header.seq > expected->second) lost_ += header.seq - expected->second;
  next_seq_[stream] = header.seq + 1;
  if (!continues || bytes.empty()) driver_->opened(stream);
  if (!bytes.empty()) driver_->take(stream, header.utime, bytes, outputs_);
}

}  // namespace roadfix
