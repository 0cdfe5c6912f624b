/// An executor with threads of its own; processes and tests make one and lend it.
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
  /// What a task throws is thrown here, the first one's, once all threads are at rest.
  void for_each(int count, const std::function<void(int)>& task) override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace roadfix
