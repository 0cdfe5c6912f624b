/// Who runs the bundle adjustment: the process decides. Results do not depend on it.
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
};

/// Runs the job at once, in the caller.
class InlineExecutor final : public Executor {
 public:
  void start(std::function<void()> job) override { job(); }
  void wait() override {}
};

}  // namespace roadfix
