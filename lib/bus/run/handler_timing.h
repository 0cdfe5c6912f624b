/// How long a stage's handlers take: for people and heartbeats, never for results.
#pragma once

#include <chrono>
#include <string>
#include <vector>

namespace roadfix {

class HandlerTiming {
 public:
  explicit HandlerTiming(std::vector<std::string> handlers) : names_(std::move(handlers)), samples_(names_.size()) {}

  struct Row {
    std::string handler;
    std::size_t calls = 0;
    double p50_us = 0.0;
    double p99_us = 0.0;
    double max_us = 0.0;
    double total_ms = 0.0;
  };
  [[nodiscard]] std::vector<Row> rows() const;

  /// Of one handler since the last call, in microseconds; 0 where it was not called.
  [[nodiscard]] double take_p99_us(std::size_t handler);
  [[nodiscard]] std::size_t handlers() const { return names_.size(); }

  /// Times from construction to destruction; does nothing without a table.
  class Scope {
   public:
    Scope(HandlerTiming* timing, std::size_t handler) : timing_(timing), handler_(handler) {
      if (timing_ != nullptr) begin_ = std::chrono::steady_clock::now();
    }
    ~Scope() {
      if (timing_ != nullptr) timing_->add(handler_, std::chrono::steady_clock::now() - begin_);
    }
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    HandlerTiming* timing_;
    std::size_t handler_;
    std::chrono::steady_clock::time_point begin_;
  };

 private:
  void add(std::size_t handler, std::chrono::steady_clock::duration duration) {
    samples_[handler].push_back(std::chrono::duration<float, std::micro>(duration).count());
  }

  std::vector<std::string> names_;
  std::vector<std::vector<float>> samples_;  // microseconds
};

}  // namespace roadfix
