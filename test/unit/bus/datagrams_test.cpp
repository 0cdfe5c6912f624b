// LCM's messages out of its datagrams, whatever the network and whoever sends do to them.
#include "bus/transport/datagrams.h"

#include <catch2/catch.hpp>
#include <random>

#include "support/wire.h"

namespace roadfix {
namespace {

using test::WireBytes;

constexpr uint64_t kSender = 7, kOther = 8;

Datagrams all_wanted() {
  return Datagrams([](std::string_view) { return true; });
}

WireBytes payload_of(std::size_t size, unsigned seed) {
  std::mt19937 random(seed);
  WireBytes bytes(size);
  for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random());
  return bytes;
}

bool is(const std::optional<WireMessage>& message, const std::string& channel, const WireBytes& payload) {
  return message && message->channel == channel &&
         std::equal(message->bytes.begin(), message->bytes.end(), payload.begin(), payload.end());
}

TEST_CASE("a short message, whole and cut at every byte") {
  const WireBytes payload = payload_of(50, 1);
  const WireBytes datagram = test::short_datagram("POSE_INS", payload, 5);
  Datagrams datagrams = all_wanted();
  CHECK(is(datagrams.take(kSender, datagram), "POSE_INS", payload));
  constexpr std::size_t kBeforePayload = 8 + 8 + 1;
  for (std::size_t size = 0; size < datagram.size(); ++size) {
    const auto message = datagrams.take(kSender, {datagram.data(), size});
    CHECK(message.has_value() == (size >= kBeforePayload));  // what is missing behind it the message's check will see
  }
  CHECK(datagrams.broken() == static_cast<int64_t>(kBeforePayload));
}

TEST_CASE("datagrams that are none of LCM's, and channels without a name or with too long a one") {
  Datagrams datagrams = all_wanted();
  for (const std::string& channel : {std::string(), std::string(64, 'x')}) {
    CHECK_FALSE(datagrams.take(kSender, test::short_datagram(channel, {1, 2, 3})));
    CHECK_FALSE(datagrams.take(kSender, test::fragments(channel, payload_of(10, 1), 20).front()));
  }
  CHECK(datagrams.take(kSender, test::short_datagram(std::string(63, 'x'), {1, 2, 3})));
  CHECK_FALSE(datagrams.take(kSender, payload_of(100, 3)));
  CHECK(datagrams.broken() == 5);
}

TEST_CASE("fragments in any order, twice, and mixed with those of other messages and senders") {
  const WireBytes one = payload_of(1000, 1), two = payload_of(777, 2), three = payload_of(900, 3);
  struct Part {
    uint64_t sender;
    WireBytes bytes;
  };
  std::vector<Part> parts;
  for (const WireBytes& part : test::fragments("ONE", one, 100, 41)) parts.push_back({kSender, part});
  for (const WireBytes& part : test::fragments("TWO", two, 100, 42)) parts.push_back({kSender, part});
  for (const WireBytes& part : test::fragments("THREE", three, 100, 41)) parts.push_back({kOther, part});
  for (unsigned seed = 0; seed < 50; ++seed) {
    std::mt19937 random(seed);
    std::vector<Part> mixed = parts;
    for (int i = 0; i < 5; ++i) mixed.push_back(mixed[random() % mixed.size()]);
    std::shuffle(mixed.begin(), mixed.end(), random);
    Datagrams datagrams = all_wanted();
    std::map<std::string, int> seen;
    for (const Part& part : mixed) {
      const auto message = datagrams.take(part.sender, part.bytes);
      if (!message) continue;
      ++seen[std::string(message->channel)];
      CHECK((is(message, "ONE", one) || is(message, "TWO", two) || is(message, "THREE", three)));
    }
    CHECK(seen == std::map<std::string, int>{{"ONE", 1}, {"TWO", 1}, {"THREE", 1}});
    CHECK(datagrams.broken() == 0);
  }
}

TEST_CASE("a message that misses a fragment never comes, and is given up when its sender is far ahead") {
  Datagrams datagrams = all_wanted();
  std::vector<WireBytes> parts = test::fragments("A", payload_of(500, 1), 100, 10);
  parts.erase(parts.begin() + 2);
  for (const WireBytes& part : parts) CHECK_FALSE(datagrams.take(kSender, part));
  CHECK(datagrams.waiting() == 1);
  const WireBytes next = payload_of(500, 2);
  for (uint32_t sequence = 11; sequence < 20; ++sequence) {
    std::optional<WireMessage> last;
    for (const WireBytes& part : test::fragments("A", next, 100, sequence)) last = datagrams.take(kSender, part);
    CHECK(is(last, "A", next));
  }
  CHECK(datagrams.waiting() == 0);
  CHECK(datagrams.given_up() == 1);
}

TEST_CASE("fragments that leave a hole, lie over each other, reach too far or contradict each other") {
  const WireBytes ten(10, 1);
  const auto fragment = [&](std::size_t size, std::size_t offset, std::size_t number, std::size_t count) {
    WireBytes bytes = test::fragment_head(1, size, offset, number, count);
    if (number == 0) test::put_channel(bytes, "A");
    bytes.insert(bytes.end(), ten.begin(), ten.end());
    return bytes;
  };
  const auto broken_by = [&](const std::vector<WireBytes>& parts) {
    Datagrams datagrams = all_wanted();
    for (const WireBytes& part : parts) CHECK_FALSE(datagrams.take(kSender, part));
    CHECK(datagrams.waiting() == 0);
    return datagrams.broken();
  };
  CHECK(broken_by({fragment(30, 0, 0, 2), fragment(30, 20, 1, 2)}) == 1);  // a hole
  CHECK(broken_by({fragment(15, 0, 0, 2), fragment(15, 5, 1, 2)}) == 1);   // over each other
  CHECK(broken_by({fragment(5, 0, 0, 1)}) == 1);                           // beyond the end
  CHECK(broken_by({fragment(20, 4'000'000'000, 1, 2)}) == 1);              // far beyond it
  CHECK(broken_by({fragment(20, 0, 2, 2)}) == 1);                          // the third of two
  CHECK(broken_by({fragment(20, 0, 0, 2), fragment(30, 10, 1, 2)}) == 1);  // another size
  CHECK(broken_by({fragment(200'000'000, 0, 0, 2)}) == 1);                 // more than two datagrams carry
  Datagrams datagrams = all_wanted();                                      // and sound ones come
  CHECK_FALSE(datagrams.take(kSender, fragment(20, 0, 0, 2)));
  CHECK(is(datagrams.take(kSender, fragment(20, 10, 1, 2)), "A", WireBytes(20, 1)));
}

TEST_CASE("what nobody wants is not kept, wherever its name comes") {
  Datagrams datagrams([](std::string_view channel) { return channel == "WANTED"; });
  CHECK_FALSE(datagrams.take(kSender, test::short_datagram("OTHER", {1})));
  CHECK(datagrams.take(kSender, test::short_datagram("WANTED", {1})));
  std::vector<WireBytes> parts = test::fragments("OTHER", payload_of(500, 1), 100, 3);
  for (const WireBytes& part : parts) CHECK_FALSE(datagrams.take(kSender, part));
  CHECK(datagrams.waiting() == 0);
  std::reverse(parts.begin(), parts.end());
  for (const WireBytes& part : parts) CHECK_FALSE(datagrams.take(kOther, part));
  CHECK(datagrams.waiting() == 0);
}

TEST_CASE("incomplete messages are bounded, and the next whole one comes all the same") {
  Datagrams datagrams = all_wanted();
  const WireBytes large = payload_of(1 << 20, 1);
  for (uint64_t sender = 0; sender < 100; ++sender) {
    static_cast<void>(datagrams.take(sender, test::fragments("A", large, 60'000).front()));
  }
  CHECK(datagrams.waiting() == Datagrams::kMaxWaitingBytes / large.size());
  CHECK(datagrams.given_up() == 100 - 16);
  const WireBytes huge = payload_of(20 << 20, 2);  // more than may wait: alone it may
  std::optional<WireMessage> last;
  for (const WireBytes& part : test::fragments("A", huge, 60'000, 9)) last = datagrams.take(kSender, part);
  CHECK(is(last, "A", huge));
}

}  // namespace
}  // namespace roadfix
