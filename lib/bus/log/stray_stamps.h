/// Messages whose stamp cannot be meant: a bit that flipped, a clock that was not set yet. In the order of utime such a
/// message stands far from its place, and whatever uses its seq there takes all others of its channel for old ones.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace roadfix {

struct Stamp {
  int64_t run = 0;
  int64_t seq = 0;
  int64_t utime = 0;
};

enum class StampError : uint8_t {
  kNone,
  kEarly,  ///< earlier than messages before it by seq
  kLate,   ///< later than messages behind it by seq
  kFar     ///< half a year or more from the middle message of the channel
};

/// What is wrong with each of one channel's messages, in any order. Early and late: where these are left out, utime
/// never falls where seq of the same run rises; they are as few as that takes.
std::vector<StampError> stamp_errors(std::span<const Stamp> stamps);

/// The same where they are few, at most one message in ten; nothing where there are more: then it is not clear which
/// ones are right (a drive that is in the log twice, a publisher that numbers anew).
std::vector<StampError> stray_stamps(std::span<const Stamp> stamps);

}  // namespace roadfix
