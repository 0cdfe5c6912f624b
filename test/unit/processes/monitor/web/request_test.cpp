// Who may ask, and what the answer is: without a socket.
#include "monitor/web/request.h"

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "bus/types/message.h"
#include "monitor/web/page.h"
#include "monitor/web/server.h"

using namespace roadfix;

namespace {

Request get(const std::string& path, const std::map<std::string, std::string>& arguments = {}) {
  Request request;
  request.method = "GET";
  request.path = path;
  request.host = "127.0.0.1:8420";
  request.argument = [arguments](const char* name) -> std::optional<std::string> {
    const auto found = arguments.find(name);
    return found == arguments.end() ? std::nullopt : std::optional(found->second);
  };
  return request;
}

image_t gray_picture() {
  image_t image{};
  image.utime = 1000;
  image.width_px = 3;
  image.height_px = 2;
  image.format = image_t::FORMAT_GRAY8;
  image.data = {1, 2, 3, 4, 5, 6};
  image.size_bytes = 6;
  return image;
}

}  // namespace

TEST_CASE("the page and its parts are there, and nothing that is not") {
  Board board("x", false);
  for (const char* path : {"/", "/index.html", "/main.js", "/map.js", "/style.css", "/uPlot.iife.min.js"}) {
    CAPTURE(path);
    CHECK(answer(get(path), board, "").status == 200);
  }
  for (const char* path : {"", "/etc/passwd", "/../main.js", "//", "/main.js/", "/frame"}) {
    CAPTURE(path);
    CHECK(answer(get(path), board, "").status == 404);
  }
}

TEST_CASE("the page can only be looked at") {
  Board board("x", false);
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS", "TRACE", "nonsense", ""}) {
    Request request = get("/");
    request.method = method;
    CHECK(answer(request, board, "").status == 405);
  }
}

TEST_CASE("without a token only names of this machine are a host, so that no other site reads along") {
  Board board("x", false);
  Request request = get("/about");
  for (const char* host : {"127.0.0.1", "127.0.0.1:8420", "localhost:1", "[::1]:8420"}) {
    request.host = host;
    CHECK(answer(request, board, "").status == 200);
  }
  for (const char* host : {"evil.example", "127.0.0.1.evil.example", "localhost.evil:80", "", "[::2]", "10.0.0.1"}) {
    request.host = host;
    CHECK(answer(request, board, "").status == 403);
  }
}

TEST_CASE("with a token: nothing without it, a cookie with it") {
  Board board("x", false);
  const std::string token = "0123456789abcdef";
  CHECK(answer(get("/"), board, token).status == 403);
  CHECK(answer(get("/live"), board, token).status == 403);
  CHECK(answer(get("/", {{"token", "0123456789abcdee"}}), board, token).status == 403);
  CHECK(answer(get("/", {{"token", ""}}), board, token).status == 403);
  const Answer in = answer(get("/", {{"token", token}}), board, token);
  CHECK(in.status == 303);
  CHECK(in.location == "/");
  CHECK_THAT(in.set_cookie,
             Catch::Contains(token) && Catch::Contains("HttpOnly") && Catch::Contains("SameSite=Strict"));
  Request request = get("/");
  request.cookie = token;
  request.host = "car.local";
  CHECK(answer(request, board, token).status == 200);
  CHECK(same_secret("", ""));
  CHECK_FALSE(same_secret("a", ""));
  CHECK_FALSE(same_secret("", "a"));
}

TEST_CASE("other machines' addresses are not listened on without a token") {
  Board board("x", false);
  CHECK_THROWS_AS(DashboardServer(board, parse_listen("0.0.0.0:0")), ServerError);
  for (const char* bad : {"", "8420", "127.0.0.1", "127.0.0.1:", "127.0.0.1:x", "127.0.0.1:70000", "host:80", ":80"}) {
    CAPTURE(bad);
    CHECK_THROWS_AS(parse_listen(bad), ServerError);
  }
  CHECK(parse_listen("[::1]:80").address == "::1");
  CHECK_FALSE(is_loopback("192.168.0.2"));
}

TEST_CASE("frames: the newest live, all of a log, never more than asked for") {
  Board live("x", false);
  live.put_frame("1");
  live.put_frame("2");
  CHECK(answer(get("/frame"), live, "").body == "2");
  CHECK(answer(get("/frames", {{"from", "0"}, {"count", "9"}}), live, "").body == "[]");
  CHECK_FALSE(live.watched());

  Board log("x", true);
  for (int i = 0; i < 200; ++i) log.put_frame(std::to_string(i));
  CHECK(answer(get("/frames", {{"from", "3"}, {"count", "2"}}), log, "").body == "[3,4]");
  CHECK(answer(get("/frames", {{"from", "199"}, {"count", "50"}}), log, "").body == "[199]");
  const std::string most = answer(get("/frames", {{"from", "0"}, {"count", "99999999"}}), log, "").body;
  CHECK(nlohmann::json::parse(most).size() == 50);
  CHECK(answer(get("/frames", {{"from", "9223372036854775807"}, {"count", "9"}}), log, "").body == "[]");
  for (const char* bad : {"-1", "", "x", "1e3", "99999999999999999999"}) {
    CHECK(answer(get("/frames", {{"from", bad}, {"count", "1"}}), log, "").status == 400);
  }
}

TEST_CASE("pictures: the one of the moment, or the newest before it") {
  Board board("x", true);
  for (const int64_t utime : {1000, 2000}) {
    image_t image = gray_picture();
    image.utime = utime;
    board.put_picture(utime, std::make_shared<const std::vector<uint8_t>>(encode(image)));
  }
  CHECK(board.picture(999) == std::nullopt);
  REQUIRE(board.picture(1500));
  CHECK(board.picture(1500)->utime == 1000);
  CHECK(board.picture(9999)->utime == 2000);
  const Answer picture = answer(get("/picture", {{"t", "1000"}}), board, "");
  CHECK(picture.mime == "image/bmp");
  // 54 bytes of head, 1024 of palette, two rows of three pixels filled up to four.
  REQUIRE(picture.body.size() == 54 + 1024 + 8);
  CHECK(picture.body.substr(54 + 1024, 3) == "\x01\x02\x03");
  CHECK(picture.body.substr(54 + 1024 + 4, 3) == "\x04\x05\x06");
  CHECK(answer(get("/picture"), board, "").status == 400);
}

TEST_CASE("a picture whose size contradicts its data is none") {
  image_t image = gray_picture();
  CHECK(web_picture(image));
  image.width_px = 30000;
  CHECK_FALSE(web_picture(image));
  image = gray_picture();
  image.height_px = -2;
  CHECK_FALSE(web_picture(image));
  image = gray_picture();
  image.format = 77;
  CHECK_FALSE(web_picture(image));
}

TEST_CASE("the history is bounded and keeps the whole drive") {
  History history;
  for (int64_t i = 0; i < 20'000; ++i) history.add({i * 500'000, 0, {{"POSE_INS", {double(i), 0.0, kNothing, 0.1}}}});
  CHECK(history.size() <= History::kMost);
  CHECK(history.size() > History::kMost / 3);
  const auto json = nlohmann::json::parse(history.json());
  CHECK(json["t"].front() == 0);
  CHECK(json["t"].back() >= 9'990'000);
  CHECK(json["poses"]["POSE_INS"]["e"].size() == history.size());
  CHECK(json["poses"]["POSE_INS"]["err"].front().is_null());
}
