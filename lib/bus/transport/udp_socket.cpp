#include "bus/transport/udp_socket.h"

#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace roadfix {

namespace {

bool is_udp_at(int fd, int port) {
  int type = 0;
  socklen_t size = sizeof type;
  if (::getsockopt(fd, SOL_SOCKET, SO_TYPE, &type, &size) != 0 || type != SOCK_DGRAM) return false;
  sockaddr_in address{};
  size = sizeof address;
  if (::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size) != 0) return false;
  return address.sin_family == AF_INET && ntohs(address.sin_port) == port;
}

/// The last column of /proc/net/udp, for the sockets with these inodes.
int64_t drops_of(const std::set<uint64_t>& inodes) {
  std::ifstream table("/proc/net/udp");
  std::string line;
  std::getline(table, line);
  int64_t drops = 0;
  while (std::getline(table, line)) {
    std::istringstream words(line);
    std::vector<std::string> columns;
    for (std::string word; words >> word;) columns.push_back(word);
    constexpr std::size_t kInode = 9;
    if (columns.size() > kInode && inodes.contains(std::stoull(columns[kInode]))) drops += std::stoll(columns.back());
  }
  return drops;
}

}  // namespace

UdpSocketFacts udp_socket_facts(int port) {
  UdpSocketFacts facts;
  std::set<uint64_t> inodes;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd", ignored)) {
    const int fd = std::stoi(entry.path().filename().string());
    if (!is_udp_at(fd, port)) continue;
    struct stat status {};
    if (::fstat(fd, &status) == 0) inodes.insert(status.st_ino);
    int bytes = 0;
    socklen_t size = sizeof bytes;
    ::getsockopt(fd, SOL_SOCKET, SO_RCVBUF, &bytes, &size);
    bytes /= 2;
    facts.receive_buffer_bytes = facts.sockets == 0 ? bytes : std::min(facts.receive_buffer_bytes, bytes);
    ++facts.sockets;
  }
  if (!inodes.empty()) facts.drops = drops_of(inodes);
  return facts;
}

}  // namespace roadfix
