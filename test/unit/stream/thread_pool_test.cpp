#include "stream/thread_pool.h"

#include <atomic>
#include <catch2/catch.hpp>
#include <stdexcept>
#include <thread>
#include <vector>

namespace roadfix {
namespace {

TEST_CASE("a thread pool runs every task of a loop once, loop after loop") {
  for (const int threads : {1, 2, 5}) {
    ThreadPool pool(threads);
    for (int loop = 0; loop < 200; ++loop) {
      std::vector<std::atomic<int>> done(static_cast<std::size_t>(loop % 17));
      pool.for_each(static_cast<int>(done.size()), [&](int i) { ++done[static_cast<std::size_t>(i)]; });
      for (const auto& d : done) REQUIRE(d == 1);
    }
  }
}

TEST_CASE("an exception of a task or job reaches the caller, and the pool continues") {
  ThreadPool pool(3);
  const auto fails = [](int i) {
    if (i == 5) throw std::runtime_error("five");
  };
  CHECK_THROWS_AS(pool.for_each(20, fails), std::runtime_error);
  pool.start([] { throw std::runtime_error("job"); });
  CHECK_THROWS_AS(pool.wait(), std::runtime_error);
  std::atomic<int> count{0};
  pool.for_each(20, [&](int) { ++count; });
  CHECK(count == 20);
}

TEST_CASE("a job runs beside loops and is waited for") {
  ThreadPool pool(2);
  std::atomic<bool> may_end{false};
  std::atomic<bool> ended{false};
  pool.start([&] {
    while (!may_end) std::this_thread::yield();
    ended = true;
  });
  std::atomic<int> count{0};
  pool.for_each(8, [&](int) { ++count; });
  CHECK(count == 8);
  CHECK_FALSE(ended);
  may_end = true;
  pool.wait();
  CHECK(ended);
}

}  // namespace
}  // namespace roadfix
