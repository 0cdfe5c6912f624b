// rosbag2's sqlite3 files: tables topics and messages, and since Iron message_definitions.
#include <fmt/format.h>
#include <sqlite3.h>

#include <array>
#include <fstream>
#include <map>
#include <set>

#include "config/config_error.h"
#include "roadfix/rosbag/bag.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

struct Close {
  void operator()(sqlite3* database) const { sqlite3_close(database); }
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};

/// sqlite uses its own page count only sometimes: a file that is shorter is cut.
void refuse_cut_file(const fs::path& path) {
  std::array<uint8_t, 100> head{};
  std::ifstream stream(path, std::ios::binary);
  stream.read(reinterpret_cast<char*>(head.data()), head.size());
  const std::string name = path.string();
  const auto size = static_cast<uint64_t>(fs::file_size(path));
  if (stream.gcount() != static_cast<std::streamsize>(head.size())) {
    throw ConfigError(name, 0,
                      fmt::format("at offset {}: is cut short, a database begins with {} bytes", size, head.size()));
  }
  if (std::string_view(reinterpret_cast<const char*>(head.data()), 16) != std::string_view("SQLite format 3\0", 16)) {
    throw ConfigError(name, 0, "at offset 0: is no sqlite3 database");
  }
  uint64_t page = (uint64_t{head[16]} << 8U) | head[17];
  if (page == 1) page = 65536;
  const uint64_t pages =
      (uint64_t{head[28]} << 24U) | (uint64_t{head[29]} << 16U) | (uint64_t{head[30]} << 8U) | uint64_t{head[31]};
  if (size < page * pages) {
    throw ConfigError(name, 0, fmt::format("at offset {}: is cut short, its head tells {} bytes", size, page * pages));
  }
  std::error_code ignored;
  const fs::path wal = name + "-wal";
  if (fs::exists(wal, ignored) && fs::file_size(wal, ignored) > 0) {
    throw ConfigError(
        wal.string(), 0,
        "the database was not closed: messages wait in here (`sqlite3 FILE 'pragma wal_checkpoint'` moves them)");
  }
}

class SqliteBag : public Bag {
 public:
  explicit SqliteBag(const fs::path& path) : name_(path.string()) {
    if (!fs::is_regular_file(path)) throw ConfigError(name_, 0, "no such file");
    refuse_cut_file(path);
    sqlite3* database = nullptr;
    const int code = sqlite3_open_v2(name_.c_str(), &database, SQLITE_OPEN_READONLY, nullptr);
    database_.reset(database);
    if (code != SQLITE_OK) fail();
  }

  void read(const Visitor& visitor) override {
    read_topics();
    const auto messages = prepare("SELECT id, topic_id, timestamp, data FROM messages ORDER BY id");
    while (step(messages)) {
      const int64_t id = sqlite3_column_int64(messages.get(), 0);
      const auto topic = topics_by_id_.find(sqlite3_column_int64(messages.get(), 1));
      if (topic == topics_by_id_.end()) {
        throw ConfigError(name_, 0, fmt::format("table messages, id {}: its topic is not in table topics", id));
      }
      visitor({topic->second,
               sqlite3_column_int64(messages.get(), 2),
               blob(messages, 3),
               {0, 0, static_cast<uint64_t>(id)}});
    }
  }

  std::vector<uint8_t> data_at(const BagPlace& place) override {
    if (!by_id_) by_id_ = prepare("SELECT data FROM messages WHERE id = ?");
    sqlite3_reset(by_id_.get());
    sqlite3_bind_int64(by_id_.get(), 1, static_cast<int64_t>(place.record));
    if (!step(by_id_)) throw ConfigError(name_, 0, fmt::format("table messages: id {} is gone", place.record));
    const auto data = blob(by_id_, 0);
    return {data.begin(), data.end()};
  }

 private:
  using Statement = std::unique_ptr<sqlite3_stmt, Close>;

  [[noreturn]] void fail() const {
    throw ConfigError(name_, 0, fmt::format("sqlite3: {}", database_ ? sqlite3_errmsg(database_.get()) : "no memory"));
  }

  Statement prepare(const char* text) const {
    sqlite3_stmt* statement = nullptr;
    if (sqlite3_prepare_v2(database_.get(), text, -1, &statement, nullptr) != SQLITE_OK) fail();
    return Statement(statement);
  }

  [[nodiscard]] bool step(const Statement& statement) const {
    const int code = sqlite3_step(statement.get());
    if (code != SQLITE_ROW && code != SQLITE_DONE) fail();
    return code == SQLITE_ROW;
  }

  static std::string text(const Statement& statement, int column) {
    const auto* bytes = reinterpret_cast<const char*>(sqlite3_column_text(statement.get(), column));
    return bytes == nullptr ? "" : bytes;
  }

  static std::span<const uint8_t> blob(const Statement& statement, int column) {
    const auto* data = static_cast<const uint8_t*>(sqlite3_column_blob(statement.get(), column));
    return {data, static_cast<std::size_t>(sqlite3_column_bytes(statement.get(), column))};
  }

  void read_topics() {
    std::map<std::string, std::string> definitions;
    const auto tables = prepare("SELECT name FROM sqlite_master WHERE name = 'message_definitions'");
    if (step(tables)) {
      const auto rows = prepare("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions");
      while (step(rows)) {
        if (text(rows, 1) == "ros2msg") definitions[plain_ros_type(text(rows, 0))] = text(rows, 2);
      }
    }
    const auto rows = prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id");
    while (step(rows)) {
      BagTopic topic{text(rows, 1), plain_ros_type(text(rows, 2)), "", RosType::Encoding::kCdr, text(rows, 3) == "cdr"};
      topic.definition = definitions[topic.type];
      topics_by_id_[sqlite3_column_int64(rows.get(), 0)] = topic_index(std::move(topic));
    }
  }

  std::string name_;
  std::unique_ptr<sqlite3, Close> database_;
  Statement by_id_;
  std::map<int64_t, std::size_t> topics_by_id_;
};

}  // namespace

std::unique_ptr<Bag> open_sqlite_bag(const fs::path& path) { return std::make_unique<SqliteBag>(path); }

}  // namespace roadfix
