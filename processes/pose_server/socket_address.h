/// "127.0.0.1:10110" or "[::1]:10110" as the system takes it.
#pragma once

#include <sys/socket.h>

#include <string>

namespace roadfix {

struct SocketAddress {
  sockaddr_storage storage{};
  socklen_t size = 0;
  [[nodiscard]] const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&storage); }
};

/// Numbers only, no names: nothing is looked up. Throws OutletError; `what` is the key of the configuration.
SocketAddress socket_address(const std::string& what, const std::string& text);

/// Closes its descriptor at the end.
class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {}
  ~Descriptor();
  Descriptor(Descriptor&& other) noexcept : number_(other.release()) {}
  Descriptor& operator=(Descriptor&& other) noexcept;
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  [[nodiscard]] int get() const { return number_; }
  [[nodiscard]] bool open() const { return number_ >= 0; }
  int release();

 private:
  int number_;
};

}  // namespace roadfix
