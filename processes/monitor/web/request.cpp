#include "monitor/web/request.h"

#include <algorithm>
#include <array>
#include <charconv>

#include "monitor/web/page.h"

namespace roadfix {

namespace {

constexpr std::size_t kMostFramesAtOnce = 50;

Answer refuse(int status, const std::string& why) {
  Answer answer;
  answer.status = status;
  answer.body = why + "\n";
  return answer;
}

Answer json(std::string body) { return {200, "application/json", std::move(body), "", "", false}; }

bool names_this_machine(const std::string& host) {
  constexpr std::array<std::string_view, 3> kNames = {"127.0.0.1", "localhost", "[::1]"};
  const std::size_t colon = host.find(':', host.starts_with('[') ? host.find(']') : 0);
  const std::string_view name = std::string_view(host).substr(0, colon);
  return std::find(kNames.begin(), kNames.end(), name) != kNames.end();
}

/// A number of the query; absent where there is none or it is not one.
std::optional<int64_t> number_of(const Request& request, const char* name) {
  const std::optional<std::string> text = request.argument(name);
  if (!text) return std::nullopt;
  int64_t value = 0;
  const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), value);
  if (error != std::errc() || end != text->data() + text->size()) return std::nullopt;
  return value;
}

Answer data(const Request& request, Board& board) {
  if (request.path == "/about") return json(board.about());
  if (request.path == "/history") return json(*board.history_json());
  if (request.path == "/frame") {
    const Board::Text frame = board.frame();
    return frame ? json(*frame) : refuse(404, "no frame yet");
  }
  if (request.path == "/frames") {
    const auto from = number_of(request, "from"), count = number_of(request, "count");
    if (!from || !count || *from < 0 || *count < 0) return refuse(400, "from and count are wanted");
    return json(
        board.frames(static_cast<std::size_t>(*from), std::min(kMostFramesAtOnce, static_cast<std::size_t>(*count))));
  }
  if (request.path == "/picture") {
    const auto utime = number_of(request, "t");
    if (!utime) return refuse(400, "t is wanted");
    const std::optional<WebPicture> picture = board.picture(*utime);
    if (!picture) return refuse(404, "no such picture");
    return {200, picture->mime, std::string(picture->bytes.begin(), picture->bytes.end()), "", "", false};
  }
  return refuse(404, "nothing here");
}

}  // namespace

bool same_secret(std::string_view a, std::string_view b) {
  unsigned difference = a.size() == b.size() ? 0U : 1U;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference |= static_cast<unsigned>(static_cast<unsigned char>(a[i]) ^
                                        static_cast<unsigned char>(b.empty() ? '\0' : b[i % b.size()]));
  }
  return difference == 0U;
}

Answer answer(const Request& request, Board& board, const std::string& token) {
  if (request.method != "GET" && request.method != "HEAD") return refuse(405, "this page can only be looked at");
  if (token.empty()) {
    if (!names_this_machine(request.host)) return refuse(403, "only for this machine");
  } else if (!same_secret(request.cookie, token)) {
    const std::optional<std::string> given = request.argument("token");
    if (!given || !same_secret(*given, token)) return refuse(403, "the address with its token is wanted");
    Answer in = refuse(303, "");
    in.location.assign(1, '/');
    in.set_cookie.append("roadfix=").append(token).append("; HttpOnly; SameSite=Strict; Path=/");
    return in;
  }
  if (request.path == "/live") return {200, "text/event-stream", "", "", "", true};
  if (const PageFile* file = page_file(request.path == "/" ? "/index.html" : request.path)) {
    return {200, file->mime, file->text, "", "", false};
  }
  return data(request, board);
}

}  // namespace roadfix
