/// An executor with its own threads, created by processes and tests.
#pragma once

#include <memory>

#include "stream/executor.h"

namespace roadfix {

class ThreadPool final : public Executor {
 public:
  /// `threads` run a loop, the caller's own among them; one job runs beside it on another thread.
  explicit ThreadPool(int threads);
  ~ThreadPool() override;
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  void start(std::function<void()> job) override;
  void wait() override;
  /// Rethrows the first exception of a task, once all threads are idle.
  void for_each(int count, const std::function<void(int)>& task) override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace roadfix
