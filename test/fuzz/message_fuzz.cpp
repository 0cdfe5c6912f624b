// Any bytes as a message of any type: what passes the check decodes, and encodes to the same bytes.
#include <cstdlib>
#include <roadfix/aiding_t.hpp>
#include <roadfix/fusion_state2_t.hpp>
#include <roadfix/heartbeat_t.hpp>
#include <roadfix/image_t.hpp>
#include <roadfix/ledger_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/state_t.hpp>
#include <roadfix/vo_features2_t.hpp>

#include "bus/types/field_difference.h"
#include "bus/types/message.h"

namespace {

template <class T>
void try_type(std::span<const uint8_t> bytes) {
  static const roadfix::MessageCheck kCheck = roadfix::Schema::built_in().check_of(T::getTypeName());
  std::vector<uint8_t> message(8);
  const auto fingerprint = static_cast<uint64_t>(T::getHash());
  for (int i = 0; i < 8; ++i) message[static_cast<std::size_t>(i)] = static_cast<uint8_t>(fingerprint >> (56 - 8 * i));
  message.insert(message.end(), bytes.begin(), bytes.end());
  if (kCheck(message) != roadfix::CheckResult::kOk) return;
  if (roadfix::encode(roadfix::decode<T>(message)).size() != message.size()) std::abort();
  if (roadfix::list_fields(roadfix::Schema::built_in(), T::getTypeName(), message).empty()) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::span<const uint8_t> bytes(data + 1, size - 1);
  using namespace roadfix;
  switch (data[0] % 8) {
    case 0:
      try_type<aiding_t>(bytes);
      break;
    case 1:
      try_type<fusion_state2_t>(bytes);
      break;
    case 2:
      try_type<heartbeat_t>(bytes);
      break;
    case 3:
      try_type<image_t>(bytes);
      break;
    case 4:
      try_type<ledger_t>(bytes);
      break;
    case 5:
      try_type<pose_t>(bytes);
      break;
    case 6:
      try_type<state_t>(bytes);
      break;
    default:
      try_type<vo_features2_t>(bytes);
      break;
  }
  return 0;
}
