#include "bus/transport/bus_url.h"

#include <arpa/inet.h>

#include <charconv>
#include <sstream>
#include <stdexcept>

namespace roadfix {

namespace {

constexpr int kMaxPort = 65535;

int parse_int(const std::string& text, const std::string& what) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < 0)
    throw std::invalid_argument(what + ": '" + text + "' is no whole number");
  return value;
}

}  // namespace

BusUrl parse_bus_url(const std::string& url) {
  const std::string scheme = "udpm://", named = "bus URL '" + url + "'";
  if (!url.starts_with(scheme)) throw std::invalid_argument(named + ": only udpm:// goes over a network");
  BusUrl parsed;
  const std::string rest = url.substr(scheme.size());
  const std::size_t question = rest.find('?');
  const std::string address = rest.substr(0, question);
  if (!address.empty()) {
    const std::size_t colon = address.find(':');
    parsed.group = address.substr(0, colon);
    if (colon != std::string::npos) parsed.port = parse_int(address.substr(colon + 1), named + ", port");
    if (parsed.port < 1 || parsed.port > kMaxPort) throw std::invalid_argument(named + ": no such port");
  }
  in_addr group{};
  if (inet_pton(AF_INET, parsed.group.c_str(), &group) != 1 || !IN_MULTICAST(ntohl(group.s_addr)))
    throw std::invalid_argument(named + ": '" + parsed.group +
                                "' is no multicast address (224.0.0.0 to 239.255.255.255)");
  if (question == std::string::npos) return parsed;
  std::istringstream arguments(rest.substr(question + 1));
  for (std::string argument; std::getline(arguments, argument, '&');) {
    if (argument.starts_with("ttl=")) parsed.ttl = parse_int(argument.substr(4), named + ", ttl");
    if (argument.starts_with("recv_buf_size="))
      parsed.receive_buffer_bytes = parse_int(argument.substr(14), named + ", recv_buf_size");
  }
  return parsed;
}

}  // namespace roadfix
