#include "monitor/dashboard.h"

#include <sys/random.h>

#include <algorithm>
#include <array>

#include "config/config.h"

namespace roadfix {

namespace {

constexpr std::size_t kShortestToken = 16;

std::string new_token() {
  std::array<unsigned char, 16> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    throw ServerError("dashboard: the system gives no random numbers for a token");
  }
  constexpr const char* kDigits = "0123456789abcdef";
  std::string token;
  for (const unsigned char byte : bytes) token += {kDigits[byte >> 4U], kDigits[byte & 15U]};
  return token;
}

/// This machine's own address needs no token; every other one does.
ServerOptions options_of(const DashboardConfig& config) {
  ServerOptions options = parse_listen(config.listen);
  options.clients = config.clients;
  if (!config.token_file.empty()) {
    std::string token = read_text_file(config.token_file);
    std::erase_if(token, [](char c) { return c == '\n' || c == '\r' || c == ' '; });
    const bool plain = std::all_of(token.begin(), token.end(), [](unsigned char c) { return std::isalnum(c) != 0; });
    if (token.size() < kShortestToken || !plain) {
      throw ServerError("dashboard: " + config.token_file + " has no token of 16 letters and digits or more");
    }
    options.token = token;
  } else if (!is_loopback(options.address)) {
    options.token = new_token();
  }
  return options;
}

}  // namespace

Dashboard::Dashboard(const DashboardConfig& config, Health& health, const std::string& name, bool log)
    : board_(name, log), view_(board_, health, config.rate, log, config.camera), server_(board_, options_of(config)) {}

}  // namespace roadfix
