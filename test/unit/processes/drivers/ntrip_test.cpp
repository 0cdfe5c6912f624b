#include "drivers/protocols/ntrip.h"

#include <catch2/catch.hpp>

#include "support/device_bytes.h"

namespace roadfix {
namespace {

using test::Bytes;

const Bytes kFrames = [] {
  Bytes frames = test::rtcm_bytes({0x3E, 0xD0, 0x01});
  test::append(frames, test::rtcm_bytes(Bytes(300, 0xD3)));
  test::append(frames, test::rtcm_bytes({0x43, 0x50}));
  return frames;
}();

/// What comes out when the caster's bytes are handed over in two pieces.
Bytes corrections(NtripAnswer& answer, const Bytes& bytes, std::size_t cut) {
  Bytes out = answer.feed(0, {bytes.data(), cut});
  test::append(out, answer.feed(0, {bytes.data() + cut, bytes.size() - cut}));
  return out;
}

Bytes with_head(const std::string& head, const Bytes& body) {
  Bytes bytes = test::bytes_of(head);
  test::append(bytes, body);
  return bytes;
}

TEST_CASE("base64 gives RFC 4648's test vectors") {
  const std::vector<std::pair<std::string, std::string>> published = {
      {"", ""},
      {"f", "Zg=="},
      {"fo", "Zm8="},
      {"foo", "Zm9v"},
      {"foob", "Zm9vYg=="},
      {"fooba", "Zm9vYmE="},
      {"foobar", "Zm9vYmFy"},
      {"Aladdin:open sesame", "QWxhZGRpbjpvcGVuIHNlc2FtZQ=="}};
  for (const auto& [text, encoded] : published) CHECK(base64(text) == encoded);
}

TEST_CASE("the request names mountpoint, host and user, and lets nothing be smuggled in") {
  NtripRequest r{"caster.example", 2101, "NEAR", "Aladdin", "open sesame"};
  const std::string text = ntrip_request(r);
  CHECK(text.starts_with("GET /NEAR HTTP/1.1\r\nHost: caster.example:2101\r\nNtrip-Version: Ntrip/2.0\r\n"));
  CHECK(text.find("Authorization: Basic QWxhZGRpbjpvcGVuIHNlc2FtZQ==\r\n") != std::string::npos);
  CHECK(text.ends_with("\r\n\r\n"));
  r.user.clear();
  CHECK(ntrip_request(r).find("Authorization") == std::string::npos);
  r.mountpoint = "X HTTP/1.1\r\nEvil: 1";
  CHECK_THROWS_AS(ntrip_request(r), std::invalid_argument);
}

TEST_CASE("both versions' answers, cut at every byte, give the whole frames") {
  Bytes chunks;
  for (std::size_t at = 0; at < kFrames.size(); at += 100) {  // chunks that cut the frames
    const std::size_t n = std::min<std::size_t>(100, kFrames.size() - at);
    char length[16];
    std::snprintf(length, sizeof length, n == 100 ? "64;x=1\r\n" : "%zx\r\n", n);
    test::append(chunks, test::bytes_of(length));
    test::append(chunks, {kFrames.begin() + static_cast<std::ptrdiff_t>(at),
                          kFrames.begin() + static_cast<std::ptrdiff_t>(at + n)});
    test::append(chunks, test::bytes_of("\r\n"));
  }
  for (const Bytes& bytes :
       {with_head("ICY 200 OK\r\n", kFrames), with_head("ICY 200 OK\r\n\r\n", kFrames),
        with_head("HTTP/1.1 200 OK\r\nNtrip-Version: Ntrip/2.0\r\nContent-Type: gnss/data\r\n\r\n", kFrames),
        with_head("HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n", chunks)}) {
    for (std::size_t cut = 0; cut <= bytes.size(); ++cut) {
      NtripAnswer answer;
      REQUIRE(corrections(answer, bytes, cut) == kFrames);
      REQUIRE(answer.state() == NtripAnswer::State::kStreaming);
      REQUIRE(answer.frames() == 3);
    }
  }
}

TEST_CASE("a damaged frame does not reach the receiver") {
  Bytes damaged = kFrames;
  damaged[20] ^= 1U;  // in the second frame
  NtripAnswer answer;
  const Bytes out = corrections(answer, with_head("ICY 200 OK\r\n", damaged), 30);
  Bytes expected = test::rtcm_bytes({0x3E, 0xD0, 0x01});
  test::append(expected, test::rtcm_bytes({0x43, 0x50}));
  CHECK(out == expected);
  CHECK(answer.bad_checksums() >= 1);
}

TEST_CASE("refusals are told in plain words") {
  const auto why = [](const std::string& text) {
    NtripAnswer answer;
    CHECK(answer.feed(0, test::bytes_of(text)).empty());
    CHECK(answer.state() == NtripAnswer::State::kRefused);
    return answer.why();
  };
  CHECK(why("HTTP/1.1 401 Unauthorized\r\n\r\n") == "HTTP/1.1 401 Unauthorized");
  CHECK(why("SOURCETABLE 200 OK\r\n").find("mountpoint") != std::string::npos);
  CHECK(why("HTTP/1.1 200 OK\r\nContent-Type: gnss/sourcetable\r\n\r\n").find("mountpoint") != std::string::npos);
  CHECK(why("ERROR - Bad Password\r\n") == "ERROR - Bad Password");
  CHECK(why("HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nxyz\r\n").find("chunk") != std::string::npos);
  CHECK(why("HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n") == "ended the stream");
  CHECK(why(std::string(9000, 'x')) == "answers no line");
}

// Found by the fuzz target "corrections": a long head passed in one piece and was refused in two.
TEST_CASE("a head that is too long is refused in whatever pieces it comes") {
  const std::string filler(NtripAnswer::kMaxHead, 'x');
  for (const std::string& text : {"HTTP/1.1 200 OK\r\nX: " + filler + "\r\n\r\n", filler + "\r\n",
                                  "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n1;" + filler + "\r\n"}) {
    const Bytes bytes = test::bytes_of(text);
    for (const std::size_t cut : {std::size_t{0}, NtripAnswer::kMaxHead - 1, NtripAnswer::kMaxHead, bytes.size() - 1}) {
      NtripAnswer answer;
      CHECK(corrections(answer, bytes, cut).empty());
      CHECK(answer.state() == NtripAnswer::State::kRefused);
      CHECK(answer.waiting_bytes() == 0);
    }
  }
  NtripAnswer longest;  // teeth: one that just fits
  corrections(longest, test::bytes_of("HTTP/1.1 200 OK\r\nX: " + filler.substr(24) + "\r\n\r\n"), 5000);
  CHECK(longest.state() == NtripAnswer::State::kStreaming);
}

}  // namespace
}  // namespace roadfix
