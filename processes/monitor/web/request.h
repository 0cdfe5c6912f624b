/// What a request may have, decided without a socket: who may ask, and what the answer is.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "monitor/web/board.h"

namespace roadfix {

struct Request {
  std::string method;
  std::string path;                                                      ///< decoded, without the query
  std::string host;                                                      ///< header
  std::string cookie;                                                    ///< of the name "roadfix"
  std::function<std::optional<std::string>(const char* name)> argument;  ///< of the query
};

struct Answer {
  int status = 200;
  std::string mime = "text/plain; charset=utf-8";
  std::string body;
  std::string location;    ///< of a redirect
  std::string set_cookie;  ///< the token, once it was right
  bool stream = false;     ///< the frames, as they come
};

/// Equal, in a time that does not depend on where they differ.
bool same_secret(std::string_view a, std::string_view b);

/// `token`: empty where none is asked for; then only names of this machine are taken as host, so that no page of
/// another site can read along (DNS rebinding).
Answer answer(const Request& request, Board& board, const std::string& token);

}  // namespace roadfix
