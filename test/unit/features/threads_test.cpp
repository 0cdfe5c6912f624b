// OpenCV's loops in several threads of one process, while each of them says how many threads OpenCV may have.
#include <catch2/catch.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <thread>
#include <vector>

#include "features/front_end.h"

TEST_CASE("stages that begin beside each other do not take OpenCV's threads from each other") {
  constexpr int kThreads = 4, kRounds = 20'000;
  std::vector<std::thread> threads;
  std::vector<int> blurred(kThreads, 0);
  for (int& count : blurred) {
    threads.emplace_back([&count] {
      const cv::Mat picture(120, 160, CV_8UC1, cv::Scalar(7));
      cv::Mat out;
      for (int i = 0; i < kRounds; ++i) {
        roadfix::fix_opencv_threads();  // cv::setNumThreads(1) here ends all of four runs with a segmentation fault
        cv::GaussianBlur(picture, out, {5, 5}, 1.0);
        cv::parallel_for_({0, 8}, [](const cv::Range&) {});
        count += out.at<uint8_t>(60, 80) == 7 ? 1 : 0;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  CHECK(blurred == std::vector<int>(kThreads, kRounds));
  CHECK(cv::getNumThreads() == 1);
}
