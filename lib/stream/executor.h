/// Interface by which a process lends its threads to libraries. Results do not depend on it: a job is awaited before
/// its result is used, and each task of a loop writes only its own part.
#pragma once

#include <functional>

namespace roadfix {

class Executor {
 public:
  virtual ~Executor() = default;
  /// Starts a job, at most one at a time.
  virtual void start(std::function<void()> job) = 0;
  /// Returns once the job is done.
  virtual void wait() = 0;
  /// Runs task(0) to task(count - 1), in any order, on any threads, and returns when all are done; by default one after
  /// the other in the caller.
  virtual void for_each(int count, const std::function<void(int)>& task) {
    for (int i = 0; i < count; ++i) task(i);
  }
};

/// Everything immediately, in the caller.
class InlineExecutor final : public Executor {
 public:
  void start(std::function<void()> job) override { job(); }
  void wait() override {}
};

}  // namespace roadfix
