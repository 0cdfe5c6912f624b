#include "monitor/web/server.h"

#include <arpa/inet.h>
#include <microhttpd.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <vector>

#include "monitor/web/port_holder.h"
#include "monitor/web/request.h"

namespace roadfix {

namespace {

constexpr int kWake_ms = 40;     ///< the longest that a new frame waits for the server's thread
constexpr int kAsleep_ms = 500;  ///< the same while nobody looks; a connection wakes it at once
constexpr int kNice = 10;        ///< the page comes after everything that drives
constexpr int kSendBufferBytes = 128 << 10;
constexpr std::size_t kRequestBytes = 16 << 10;
constexpr std::size_t kStreamBlockBytes = 16 << 10;

struct Address {
  sockaddr_storage storage{};
};

Address address_of(const ServerOptions& options) {
  Address address;
  auto* v4 = reinterpret_cast<sockaddr_in*>(&address.storage);
  auto* v6 = reinterpret_cast<sockaddr_in6*>(&address.storage);
  const auto port = htons(static_cast<uint16_t>(options.port));
  if (inet_pton(AF_INET, options.address.c_str(), &v4->sin_addr) == 1) {
    v4->sin_family = AF_INET;
    v4->sin_port = port;
  } else if (inet_pton(AF_INET6, options.address.c_str(), &v6->sin6_addr) == 1) {
    v6->sin6_family = AF_INET6;
    v6->sin6_port = port;
  } else {
    throw ServerError("dashboard: '" + options.address + "' is no address");
  }
  return address;
}

std::string text_of(const char* text) { return text != nullptr ? text : ""; }

}  // namespace

ServerOptions parse_listen(const std::string& listen) {
  const std::size_t colon = listen.rfind(':');
  ServerOptions options;
  if (colon == std::string::npos) throw ServerError("dashboard: '" + listen + "' is no address:port");
  options.address = listen.substr(0, colon);
  if (options.address.starts_with('[') && options.address.ends_with(']')) {
    options.address = options.address.substr(1, options.address.size() - 2);
  }
  const char* end = listen.data() + listen.size();
  const auto [stop, error] = std::from_chars(listen.data() + colon + 1, end, options.port);
  if (error != std::errc() || stop != end || options.port < 0 || options.port > 65535) {
    throw ServerError("dashboard: '" + listen + "' has no port");
  }
  address_of(options);
  return options;
}

bool is_loopback(const std::string& address) { return address.starts_with("127.") || address == "::1"; }

/// Everything that touches the HTTP library; used by the server's thread alone once it runs.
class DashboardServer::Connections {
 public:
  Connections(Board& board, const ServerOptions& options) : board_(board), token_(options.token) {
    const Address address = address_of(options);
    const unsigned v6 = address.storage.ss_family == AF_INET6 ? static_cast<unsigned>(MHD_USE_IPv6) : 0U;
    daemon_ = MHD_start_daemon(MHD_USE_EPOLL | MHD_ALLOW_SUSPEND_RESUME | v6, 0, nullptr, nullptr, &on_request, this,
                               MHD_OPTION_SOCK_ADDR, reinterpret_cast<const sockaddr*>(&address.storage),
                               MHD_OPTION_CONNECTION_LIMIT, static_cast<unsigned>(options.clients),
                               MHD_OPTION_CONNECTION_TIMEOUT, static_cast<unsigned>(options.patience_s),
                               MHD_OPTION_CONNECTION_MEMORY_LIMIT, kRequestBytes, MHD_OPTION_NOTIFY_CONNECTION,
                               &on_connection, this, MHD_OPTION_END);
    if (daemon_ == nullptr) {
      const int why = errno;
      const std::optional<std::string> holder = why == EADDRINUSE ? port_holder(options.port) : std::nullopt;
      throw ListenError("dashboard: cannot listen on " + options.address + ":" + std::to_string(options.port) + ": " +
                            std::strerror(why) + (holder && !holder->empty() ? " (" + *holder + ")" : ""),
                        why == EADDRINUSE);
    }
  }
  ~Connections() {
    for (Stream* stream : waiting_) MHD_resume_connection(stream->connection);
    waiting_.clear();
    MHD_stop_daemon(daemon_);
  }
  Connections(const Connections&) = delete;
  Connections& operator=(const Connections&) = delete;

  [[nodiscard]] int port() const { return MHD_get_daemon_info(daemon_, MHD_DAEMON_INFO_BIND_PORT)->port; }

  void step() {
    if (board_.frame_number() != seen_) {
      seen_ = board_.frame_number();
      for (Stream* stream : waiting_) MHD_resume_connection(stream->connection);
      waiting_.clear();
    }
    MHD_run_wait(daemon_, streams_ > 0 ? kWake_ms : kAsleep_ms);
  }

 private:
  /// One client's place in the stream: the frame it is being sent, and how much of it has gone.
  struct Stream {
    Connections* owner = nullptr;
    MHD_Connection* connection = nullptr;
    int64_t number = 0;
    std::string text;
    std::size_t sent = 0;
  };

  static void on_connection(void* self, MHD_Connection* connection, void**, MHD_ConnectionNotificationCode code) {
    auto* connections = static_cast<Connections*>(self);
    connections->open_ += code == MHD_CONNECTION_NOTIFY_STARTED ? 1 : -1;
    if (code != MHD_CONNECTION_NOTIFY_STARTED) return;
    const int fd = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd;
    setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &kSendBufferBytes, sizeof kSendBufferBytes);
  }

  static MHD_Result on_request(void* self, MHD_Connection* connection, const char* url, const char* method, const char*,
                               const char*, std::size_t*, void**) {
    auto* connections = static_cast<Connections*>(self);
    Request request;
    request.method = method;
    request.path = url;
    request.host = text_of(MHD_lookup_connection_value(connection, MHD_HEADER_KIND, MHD_HTTP_HEADER_HOST));
    request.cookie = text_of(MHD_lookup_connection_value(connection, MHD_COOKIE_KIND, "roadfix"));
    request.argument = [connection](const char* name) -> std::optional<std::string> {
      const char* value = MHD_lookup_connection_value(connection, MHD_GET_ARGUMENT_KIND, name);
      return value != nullptr ? std::optional<std::string>(value) : std::nullopt;
    };
    return connections->reply(connection, answer(request, connections->board_, connections->token_));
  }

  MHD_Result reply(MHD_Connection* connection, const Answer& answer) {
    MHD_Response* response = nullptr;
    if (answer.stream) {
      auto* stream = new Stream{this, connection, 0, "retry: 1000\n\n", 0};
      ++streams_;
      board_.set_clients(streams_);
      response = MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, kStreamBlockBytes, &on_read, stream, &on_end);
    } else {
      response = MHD_create_response_from_buffer(answer.body.size(), const_cast<char*>(answer.body.data()),
                                                 MHD_RESPMEM_MUST_COPY);
    }
    const auto header = [response](const char* name, const std::string& value) {
      if (!value.empty()) MHD_add_response_header(response, name, value.c_str());
    };
    header("Content-Type", answer.mime);
    header("Location", answer.location);
    header("Set-Cookie", answer.set_cookie);
    header("Cache-Control", answer.mime.starts_with("image/") ? "private, max-age=60" : "no-store");
    header("Content-Security-Policy",
           "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; frame-ancestors 'none'");
    header("X-Content-Type-Options", "nosniff");
    header("Referrer-Policy", "no-referrer");
    if (answer.status == MHD_HTTP_METHOD_NOT_ALLOWED) header("Allow", "GET, HEAD");
    const MHD_Result result = MHD_queue_response(connection, static_cast<unsigned>(answer.status), response);
    MHD_destroy_response(response);
    return result;
  }

  static ssize_t on_read(void* cls, uint64_t, char* buffer, std::size_t room) {
    auto* stream = static_cast<Stream*>(cls);
    return stream->owner->read(*stream, buffer, room);
  }

  ssize_t read(Stream& stream, char* buffer, std::size_t room) {
    if (stream.sent == stream.text.size()) {
      const int64_t newest = board_.frame_number();
      const Board::Text frame = board_.frame();
      if (newest == stream.number || !frame) {
        waiting_.push_back(&stream);
        MHD_suspend_connection(stream.connection);
        return 0;
      }
      stream.number = newest;
      stream.text = "data: " + *frame + "\n\n";
      stream.sent = 0;
    }
    const std::size_t size = std::min(room, stream.text.size() - stream.sent);
    std::copy_n(stream.text.data() + stream.sent, size, buffer);
    stream.sent += size;
    return static_cast<ssize_t>(size);
  }

  static void on_end(void* cls) {
    auto* stream = static_cast<Stream*>(cls);
    Connections* owner = stream->owner;
    std::erase(owner->waiting_, stream);
    owner->board_.set_clients(--owner->streams_);
    delete stream;
  }

  Board& board_;
  std::string token_;
  MHD_Daemon* daemon_ = nullptr;
  std::vector<Stream*> waiting_;  ///< suspended until there is a new frame
  int64_t seen_ = 0;
  int streams_ = 0;
  int open_ = 0;
};

DashboardServer::DashboardServer(Board& board, const ServerOptions& options) : options_(options) {
  if (options.token.empty() && !is_loopback(options.address)) {
    throw ServerError("dashboard: " + options.address + " is reached from other machines: a token is wanted");
  }
  connections_ = std::make_unique<Connections>(board, options);
  options_.port = connections_->port();
  thread_ = std::thread([this] { serve(); });
}

DashboardServer::~DashboardServer() {
  stop_ = true;
  thread_.join();
}

void DashboardServer::serve() {
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNice);
  while (!stop_) connections_->step();
}

std::string DashboardServer::url() const {
  const bool v6 = options_.address.find(':') != std::string::npos;
  const std::string address = v6 ? "[" + options_.address + "]" : options_.address;
  const std::string token = options_.token.empty() ? "" : "?token=" + options_.token;
  return "http://" + address + ":" + std::to_string(options_.port) + "/" + token;
}

}  // namespace roadfix
