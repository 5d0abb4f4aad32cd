// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/run_labeller.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <random>
#include <string>

namespace rigcal::agent::run_labeller_test {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;

std::vector<ComponentSums> Label(const cv::Mat1b& mask, RunLabeller* labeller) {
  const int word_count = (mask.cols + 63) / 64;
  labeller->Start(word_count);
  for (int y = 0; y < mask.rows; ++y) {
    std::vector<uint64_t> words(static_cast<size_t>(word_count));
    for (int x = 0; x < mask.cols; ++x) {
      words[static_cast<size_t>(x) / 64] |= uint64_t{mask(y, x) != 0} << (x % 64);
    }
    labeller->AddRow(y, 0, words.data(), word_count);
  }
  return labeller->Finish();
}

// Sums of the pixels of each of OpenCV's labels, in the order of their first pixels.
std::vector<ComponentSums> Reference(const cv::Mat1b& mask) {
  cv::Mat1i labels;
  cv::Mat stats, centroids;
  const int count = cv::connectedComponentsWithStats(mask, labels, stats, centroids, 8, CV_32S);
  std::vector<int> place(static_cast<size_t>(count), -1);
  std::vector<ComponentSums> components;
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      if (labels(y, x) == 0) continue;
      int& at = place[static_cast<size_t>(labels(y, x))];
      if (at < 0) {
        at = static_cast<int>(components.size());
        components.emplace_back();
      }
      ComponentSums& sums = components[static_cast<size_t>(at)];
      ++sums.area;
      sums.x += x;
      sums.y += y;
      sums.xx += int64_t{x} * x;
      sums.xy += int64_t{x} * y;
      sums.yy += int64_t{y} * y;
      sums.min_x = std::min(sums.min_x, x);
      sums.max_x = std::max(sums.max_x, x);
      sums.min_y = std::min(sums.min_y, y);
      sums.max_y = std::max(sums.max_y, y);
    }
  }
  return components;
}

void ExpectAsReference(const cv::Mat1b& mask, RunLabeller* labeller, const std::string& what) {
  const std::vector<ComponentSums> found = Label(mask, labeller);
  const std::vector<ComponentSums> expected = Reference(mask);
  ASSERT_EQ(found.size(), expected.size()) << what;
  for (size_t i = 0; i < found.size(); ++i) {
    const ComponentSums& a = found[i];
    const ComponentSums& b = expected[i];
    EXPECT_TRUE(a.area == b.area && a.x == b.x && a.y == b.y && a.xx == b.xx && a.xy == b.xy &&
                a.yy == b.yy && a.min_x == b.min_x && a.max_x == b.max_x && a.min_y == b.min_y &&
                a.max_y == b.max_y)
        << what << ", component " << i << ", area " << a.area << " instead of " << b.area;
  }
}

cv::Mat1b Draw(const std::vector<std::string>& rows) {
  cv::Mat1b mask(static_cast<int>(rows.size()), static_cast<int>(rows[0].size()));
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      mask(y, x) = rows[static_cast<size_t>(y)][static_cast<size_t>(x)] == '#' ? 255 : 0;
    }
  }
  return mask;
}

TEST(RunLabeller, JoinsWhatTouches) {
  RunLabeller labeller;
  EXPECT_THAT(Label(Draw({"#...", ".#..", "..#.", "...#"}), &labeller), SizeIs(1));
  EXPECT_THAT(Label(Draw({"...#", "..#.", ".#..", "#..."}), &labeller), SizeIs(1));
  EXPECT_THAT(Label(Draw({"#.#", "#.#", "###"}), &labeller), SizeIs(1));
  EXPECT_THAT(Label(Draw({"#.#.#.#", "#.#.#.#", "#######"}), &labeller), SizeIs(1));
  EXPECT_THAT(Label(Draw({"#.##", "..##", "#...", "#..#"}), &labeller), SizeIs(4));
  EXPECT_THAT(Label(Draw({"##", "..", "##"}), &labeller), SizeIs(2));
  EXPECT_THAT(Label(Draw({"...", "..."}), &labeller), IsEmpty());
}

TEST(RunLabeller, FollowsSpiralsAndCombs) {
  RunLabeller labeller;
  for (const int size : {5, 63, 64, 65, 200}) {
    cv::Mat1b spiral(size, size, uint8_t{0});
    for (int ring = 0; 4 * ring < size; ++ring) {
      const int low = 2 * ring, high = size - 1 - 2 * ring;
      cv::rectangle(spiral, {low, low}, {high, high}, 255);
      if (low + 2 < high) {  // opened, and led on to the next ring
        spiral(low + 1, low) = 0;
        spiral(low + 2, low + 1) = 255;
      }
    }
    ExpectAsReference(spiral, &labeller, "spiral");
    cv::Mat1b comb(size, size, uint8_t{0});
    for (int x = 0; x < size; x += 2) comb.col(x).rowRange(x % 7 % size, size) = 255;
    comb.row(size - 1) = 255;
    ExpectAsReference(comb, &labeller, "comb");
    cv::Mat1b reversed;
    cv::flip(comb, reversed, -1);
    ExpectAsReference(reversed, &labeller, "reversed comb");
  }
}

TEST(RunLabeller, FindsTheComponentsThatOpenCvFinds) {
  RunLabeller labeller;
  std::mt19937 random(5);
  for (int trial = 0; trial < 300; ++trial) {
    const int width = 1 + trial % 150;
    const int height = 1 + trial % 61;
    std::bernoulli_distribution taken(0.02 + 0.96 * (trial % 17) / 16);
    cv::Mat1b mask(height, width);
    for (uint8_t& pixel : mask) pixel = taken(random) ? 255 : 0;
    ExpectAsReference(mask, &labeller, "trial " + std::to_string(trial));
  }
}

TEST(RunLabeller, TakesAWholePictureAndACheckerboard) {
  RunLabeller labeller;
  cv::Mat1b mask(1024, 1280, uint8_t{255});
  ExpectAsReference(mask, &labeller, "all");
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) mask(y, x) = (x + y) % 2 == 0 ? 255 : 0;
  }
  ExpectAsReference(mask, &labeller, "checkerboard");
  for (int y = 1; y < mask.rows; y += 2) mask.row(y) = 0;
  ExpectAsReference(mask, &labeller, "single pixels");
}

TEST(RunLabeller, KeepsRowsApartThatWereLeftOut) {
  RunLabeller labeller;
  const uint64_t words[2] = {uint64_t{1} << 63, 1};
  labeller.Start(2);
  labeller.AddRow(3, 640, words, 2);
  labeller.AddRow(5, 640, words, 2);
  labeller.AddRow(6, 640, words, 2);
  const std::vector<ComponentSums>& components = labeller.Finish();
  ASSERT_THAT(components, SizeIs(2));
  EXPECT_EQ(components[0].area, 2);
  EXPECT_EQ(components[0].min_x, 703);
  EXPECT_EQ(components[0].max_x, 704);
  EXPECT_EQ(components[1].area, 4);
  EXPECT_EQ(components[1].min_y, 5);
}

}  // namespace
}  // namespace rigcal::agent::run_labeller_test
