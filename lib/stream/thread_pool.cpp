#include "stream/thread_pool.h"

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace roadfix {

struct ThreadPool::Impl {
  std::mutex mutex;
  std::condition_variable changed;
  std::vector<std::thread> workers;
  std::thread job;
  std::exception_ptr job_failure;
  // The loop under way, guarded by the mutex but for `next`.
  const std::function<void(int)>* task = nullptr;
  int count = 0;
  int busy = 0;                // workers in it
  std::uint64_t loops = 0;     // started so far
  std::exception_ptr failure;  // the first one's
  bool ends = false;
  std::atomic<int> next{0};

  void take_part(const std::function<void(int)>& f, int n) {
    try {
      for (int i = next.fetch_add(1); i < n; i = next.fetch_add(1)) f(i);
    } catch (...) {
      next = n;
      const std::lock_guard lock(mutex);
      if (failure == nullptr) failure = std::current_exception();
    }
  }

  void work() {
    std::uint64_t seen = 0;
    std::unique_lock lock(mutex);
    while (true) {
      changed.wait(lock, [&] { return ends || loops != seen; });
      if (ends) return;
      seen = loops;
      if (task == nullptr) continue;  // the others have finished the loop
      ++busy;
      const auto& f = *task;
      const int n = count;
      lock.unlock();
      take_part(f, n);
      lock.lock();
      if (--busy == 0) changed.notify_all();
    }
  }
};

ThreadPool::ThreadPool(int threads) : impl_(std::make_unique<Impl>()) {
  for (int i = 1; i < threads; ++i) impl_->workers.emplace_back([this] { impl_->work(); });
}

ThreadPool::~ThreadPool() {
  if (impl_->job.joinable()) impl_->job.join();
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->ends = true;
  }
  impl_->changed.notify_all();
  for (std::thread& worker : impl_->workers) worker.join();
}

void ThreadPool::start(std::function<void()> job) {
  wait();
  impl_->job = std::thread([this, job = std::move(job)] {
    try {
      job();
    } catch (...) {
      impl_->job_failure = std::current_exception();
    }
  });
}

void ThreadPool::wait() {
  if (!impl_->job.joinable()) return;
  impl_->job.join();
  if (impl_->job_failure != nullptr) std::rethrow_exception(std::exchange(impl_->job_failure, nullptr));
}

void ThreadPool::for_each(int count, const std::function<void(int)>& task) {
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->task = &task;
    impl_->count = count;
    impl_->next = 0;
    ++impl_->loops;
  }
  impl_->changed.notify_all();
  impl_->take_part(task, count);
  std::unique_lock lock(impl_->mutex);
  impl_->changed.wait(lock, [&] { return impl_->busy == 0; });
  impl_->task = nullptr;
  if (impl_->failure != nullptr) std::rethrow_exception(std::exchange(impl_->failure, nullptr));
}

}  // namespace roadfix
