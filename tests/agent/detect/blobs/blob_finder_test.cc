// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/blob_finder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "tests/agent/detect/blobs/reference_mask.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::blob_finder_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr uint8_t kWarm[3] = {40, 120, 230};

void Paint(const PixelRect& rect, Image* image) {
  for (int y = rect.y; y < rect.y + rect.height; ++y) {
    for (int x = rect.x; x < rect.x + rect.width; ++x) {
      std::copy(kWarm, kWarm + 3, image->Pixel(x, y));
    }
  }
}

int PixelsOf(const BlobResult& found) {
  int pixels = 0;
  for (const Blob& blob : found.blobs) pixels += blob.area_px;
  return pixels;
}

BlobFinderOptions TakesAll() {
  BlobFinderOptions options;
  options.min_area_px = 1;
  options.max_area_px = std::numeric_limits<int>::max();
  options.max_blobs = 100000;
  return options;
}

using Pixels = std::vector<std::pair<int, int>>;

// Components by flooding, pixel by pixel, in the order of their first pixels.
std::vector<Pixels> Flood(const Image& image, const PixelRect& window, const ColourRange& range) {
  PixelMask left(image.width, image.height);
  for (int y = window.y; y < window.y + window.height; ++y) {
    for (int x = window.x; x < window.x + window.width; ++x) {
      left.Set(x, y, image.InRange(range, x, y));
    }
  }
  std::vector<Pixels> components;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (!left.Get(x, y)) continue;
      Pixels pixels = {{x, y}};
      left.Set(x, y, false);
      for (size_t i = 0; i < pixels.size(); ++i) {
        for (int k = 0; k < 9; ++k) {
          const int at_x = pixels[i].first + k % 3 - 1, at_y = pixels[i].second + k / 3 - 1;
          if (!left.Get(at_x, at_y)) continue;
          left.Set(at_x, at_y, false);
          pixels.emplace_back(at_x, at_y);
        }
      }
      components.push_back(pixels);
    }
  }
  return components;
}

Blob Measure(const Pixels& pixels) {
  Blob blob;
  const auto n = static_cast<double>(pixels.size());
  for (const auto& [x, y] : pixels) blob.centre_px += Eigen::Vector2d(x, y) / n;
  for (const auto& [x, y] : pixels) {
    const Eigen::Vector2d d = Eigen::Vector2d(x, y) - blob.centre_px;
    blob.second_moment_px2 += d * d.transpose() / n;
  }
  blob.area_px = static_cast<int>(pixels.size());
  return blob;
}

void ExpectAsFlooded(const Image& image, const PixelRect& window, const ColourRange& range,
                     const BlobResult& found) {
  const std::vector<Pixels> expected = Flood(image, window, range);
  ASSERT_EQ(found.blobs.size(), expected.size());
  for (size_t i = 0; i < expected.size(); ++i) {
    const Blob& blob = found.blobs[i];
    const Blob measured = Measure(expected[i]);
    ASSERT_EQ(blob.area_px, measured.area_px) << i;
    ASSERT_LT((blob.centre_px - measured.centre_px).norm(), 1e-9) << i;
    ASSERT_LT((blob.second_moment_px2 - measured.second_moment_px2).norm(), 1e-9) << i;
  }
}

TEST(BlobFinderOptions, NamesEveryFault) {
  EXPECT_THAT(BlobFinderOptions{}.Validate(), IsOk());
  BlobFinderOptions options;
  options.colour.value_min = 300;
  options.min_area_px = 0;
  options.max_area_px = -3;
  options.max_blobs = 0;
  EXPECT_THAT(BlobFinder::Create(options).status(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("value_min is 300"), HasSubstr("min_area is 0"),
                             HasSubstr("max_area is -3"), HasSubstr("max_blobs is 0"))));
}

TEST(BlobFinder, MeasuresARectangle) {
  ASSERT_OK_AND_ASSIGN(BlobFinder finder, BlobFinder::Create({}));
  Image image(100, 50);
  Paint({60, 10, 9, 5}, &image);
  const BlobResult& found = finder.Find(image.View());
  ASSERT_THAT(found.blobs, SizeIs(1));
  const Blob& blob = found.blobs[0];
  EXPECT_EQ(blob.centre_px, Eigen::Vector2d(64, 12));
  EXPECT_DOUBLE_EQ(blob.second_moment_px2(0, 0), (9.0 * 9 - 1) / 12);
  EXPECT_DOUBLE_EQ(blob.second_moment_px2(1, 1), (5.0 * 5 - 1) / 12);
  EXPECT_EQ(blob.second_moment_px2(0, 1), 0);
  EXPECT_EQ(blob.area_px, 45);
  EXPECT_EQ(blob.box, (PixelRect{60, 10, 9, 5}));
  EXPECT_FALSE(blob.touches_border);
}

TEST(BlobFinder, FindsWhatFloodingFinds) {
  for (const MaskKernel* kernel : AvailableMaskKernels()) {
    for (const PixelFormat format : {PixelFormat::kBgr8, PixelFormat::kMono8}) {
      ASSERT_OK_AND_ASSIGN(BlobFinder finder, BlobFinder::Create(TakesAll(), *kernel));
      for (int trial = 0; trial < 60; ++trial) {
        Image image(1 + 7 * trial % 171, 1 + 5 * trial % 43, format, trial % 4);
        FillRandomly(static_cast<uint32_t>(trial), 0.1 * (trial % 11), &image);
        ExpectAsFlooded(image, image.View().Bounds(), ColourRange{}, finder.Find(image.View()));
        if (HasFatalFailure()) FAIL() << kernel->name << ", trial " << trial;
      }
    }
  }
}

// A second finder that reads only the words that the first one noted finds what it would find
// alone.
TEST(BlobFinder, ReadsOnlyWhatIsBright) {
  BlobFinderOptions options = TakesAll(), brighter = TakesAll();
  brighter.colour.value_min = 150;
  ASSERT_OK_AND_ASSIGN(BlobFinder first, BlobFinder::Create(options));
  ASSERT_OK_AND_ASSIGN(BlobFinder second, BlobFinder::Create(brighter));
  for (const int width : {3, 64, 150, 320}) {
    Image image(width, 20);
    for (const double share : {0.0, 0.001, 0.02, 0.5}) {
      FillRandomly(7, share, &image);
      BrightWords bright;
      ExpectAsFlooded(image, image.View().Bounds(), options.colour,
                      first.Look(image.View(), &bright));
      for (const PixelRect& window : {image.View().Bounds(), PixelRect{1, 5, width / 2 + 1, 9}}) {
        ExpectAsFlooded(image, window, brighter.colour, second.Find(image.View(), window, &bright));
      }
    }
  }
}

TEST(BlobFinder, AssumesThatWhatItDidNotReachIsBright) {
  BlobFinderOptions options = TakesAll(), few = TakesAll();
  few.max_runs = 3;
  ASSERT_OK_AND_ASSIGN(BlobFinder all, BlobFinder::Create(options));
  ASSERT_OK_AND_ASSIGN(BlobFinder first, BlobFinder::Create(few));
  Image image(320, 20);
  FillRandomly(8, 0.5, &image);
  BrightWords bright;
  ASSERT_TRUE(first.Look(image.View(), &bright).cut_short);
  ExpectAsFlooded(image, image.View().Bounds(), options.colour,
                  all.Find(image.View(), image.View().Bounds(), &bright));
}

// What was dark for the one that noted it is bright for a dimmer one.
TEST(BlobFinder, ADimmerOneReadsEverything) {
  BlobFinderOptions brighter = TakesAll();
  brighter.colour.value_min = 150;
  ASSERT_OK_AND_ASSIGN(BlobFinder first, BlobFinder::Create(brighter));
  ASSERT_OK_AND_ASSIGN(BlobFinder all, BlobFinder::Create(TakesAll()));
  Image image(320, 20);
  FillRandomly(9, 0.02, &image);
  for (uint8_t& value : image.bytes) value = static_cast<uint8_t>(value / 2);
  BrightWords bright;
  first.Look(image.View(), &bright);
  ExpectAsFlooded(image, image.View().Bounds(), TakesAll().colour,
                  all.Find(image.View(), image.View().Bounds(), &bright));
}

// Pixels beside the window must not leak in, wherever its edges fall within the words.
TEST(BlobFinder, SearchesWindowsAtEveryPlace) {
  ASSERT_OK_AND_ASSIGN(BlobFinder finder, BlobFinder::Create(TakesAll()));
  Image image(150, 6);
  FillRandomly(11, 0.6, &image);
  for (int x = 0; x < image.width; x += 1) {
    for (const int width : {1, 2, 31, 63, 64, 65, 128, 150}) {
      const PixelRect window = {x, 1, std::min(width, image.width - x), 4};
      ExpectAsFlooded(image, window, ColourRange{}, finder.Find(image.View(), window));
      if (HasFatalFailure()) FAIL() << "window at " << x << ", " << width << " wide";
    }
  }
}

TEST(BlobFinder, CutsWindowsAtThePicture) {
  ASSERT_OK_AND_ASSIGN(BlobFinder finder, BlobFinder::Create(TakesAll()));
  Image image(70, 20);
  FillRandomly(12, 0.3, &image);
  constexpr int kMax = std::numeric_limits<int>::max();
  constexpr int kMin = std::numeric_limits<int>::min();
  ExpectAsFlooded(image, image.View().Bounds(), ColourRange{},
                  finder.Find(image.View(), {-10, -10, kMax, kMax}));
  ExpectAsFlooded(image, {65, 15, 5, 5}, ColourRange{},
                  finder.Find(image.View(), {65, 15, kMax, kMax}));
  for (const PixelRect& window : {PixelRect{70, 0, 5, 5},
                                  {0, 20, 5, 5},
                                  {-5, 0, 5, 5},
                                  {3, 3, 0, 4},
                                  {3, 3, 4, -1},
                                  {kMax, kMax, kMax, kMax},
                                  {kMin, kMin, kMax, kMax},
                                  {kMin, 0, kMin, 5}}) {
    const BlobResult& found = finder.Find(image.View(), window);
    EXPECT_THAT(found.blobs, IsEmpty());
  }
}

TEST(BlobFinder, HasNoBlobsWithoutPixels) {
  ASSERT_OK_AND_ASSIGN(BlobFinder finder, BlobFinder::Create(TakesAll()));
  EXPECT_THAT(finder.Find(ImageView{}).blobs, IsEmpty());
  EXPECT_THAT(finder.Find(ImageView{nullptr, 10, 10, 30, PixelFormat::kBgr8}).blobs, IsEmpty());
}

TEST(BlobFinder, TakesAPictureOfOnePixel) {
  ASSERT_OK_AND_ASSIGN(BlobFinder finder, BlobFinder::Create(TakesAll()));
  Image image(1, 1);
  EXPECT_THAT(finder.Find(image.View()).blobs, IsEmpty());
  Paint({0, 0, 1, 1}, &image);
  const BlobResult& found = finder.Find(image.View());
  ASSERT_THAT(found.blobs, SizeIs(1));
  EXPECT_TRUE(found.blobs[0].touches_border);
  EXPECT_EQ(found.blobs[0].second_moment_px2, Eigen::Matrix2d::Zero());
}

TEST(BlobFinder, SaysWhatTouchesThePicturesBorder) {
  ASSERT_OK_AND_ASSIGN(BlobFinder finder, BlobFinder::Create(TakesAll()));
  for (const auto& [rect, touches] :
       std::vector<std::pair<PixelRect, bool>>{{{0, 5, 3, 3}, true},
                                               {{5, 0, 3, 3}, true},
                                               {{77, 5, 3, 3}, true},
                                               {{5, 37, 3, 3}, true},
                                               {{1, 1, 3, 3}, false},
                                               {{76, 36, 3, 3}, false}}) {
    Image image(80, 40);
    Paint(rect, &image);
    const BlobResult& found = finder.Find(image.View());
    ASSERT_THAT(found.blobs, SizeIs(1));
    EXPECT_EQ(found.blobs[0].touches_border, touches) << rect.x << " " << rect.y;
  }
  Image image(80, 40);
  Paint({20, 20, 10, 10}, &image);
  const BlobResult& cut = finder.Find(image.View(), {22, 22, 5, 5});
  ASSERT_THAT(cut.blobs, SizeIs(1));
  EXPECT_FALSE(cut.blobs[0].touches_border);
}

TEST(BlobFinder, CountsWhatItDoesNotKeep) {
  BlobFinderOptions options;
  options.min_area_px = 4;
  options.max_area_px = 30;
  options.max_blobs = 2;
  ASSERT_OK_AND_ASSIGN(BlobFinder finder, BlobFinder::Create(options));
  Image image(200, 60);
  Paint({1, 1, 3, 1}, &image);   // too small
  Paint({10, 1, 2, 2}, &image);  // smallest of those in range
  Paint({20, 1, 5, 4}, &image);
  Paint({40, 1, 6, 5}, &image);
  Paint({60, 1, 3, 3}, &image);
  Paint({80, 20, 31, 1}, &image);  // too large
  const BlobResult& found = finder.Find(image.View());
  EXPECT_EQ(found.over_limit, 2);
  ASSERT_THAT(found.blobs, SizeIs(2));
  EXPECT_EQ(found.blobs[0].box, (PixelRect{20, 1, 5, 4}));
  EXPECT_EQ(found.blobs[1].box, (PixelRect{40, 1, 6, 5}));
}

TEST(BlobFinder, KeepsTheFirstOfEqualBlobs) {
  BlobFinderOptions options = TakesAll();
  options.max_blobs = 512;
  ASSERT_OK_AND_ASSIGN(BlobFinder finder, BlobFinder::Create(options));
  Image image(1280, 1024);
  int count = 0;
  for (int y = 2; y < 1020; y += 8) {
    for (int x = 2; x < 1270; x += 10, ++count) Paint({x, y, 3, 3}, &image);
  }
  const BlobResult& found = finder.Find(image.View());
  ASSERT_THAT(found.blobs, SizeIs(512));
  EXPECT_EQ(found.over_limit, count - 512);
  for (int i = 0; i < 512; ++i) {
    const Blob& blob = found.blobs[static_cast<size_t>(i)];
    ASSERT_EQ(blob.box, (PixelRect{2 + 10 * (i % 127), 2 + 8 * (i / 127), 3, 3})) << i;
  }
}

TEST(BlobFinder, TakesAPictureThatIsAllBright) {
  for (const MaskKernel* kernel : AvailableMaskKernels()) {
    ASSERT_OK_AND_ASSIGN(BlobFinder finder, BlobFinder::Create({}, *kernel));
    Image image(1280, 1024);
    std::fill(image.bytes.begin(), image.bytes.end(), uint8_t{255});
    const BlobResult& found = finder.Find(image.View());
    EXPECT_THAT(found.blobs, IsEmpty());
  }
}

TEST(BlobFinder, IgnoresPixelsItWasToldTo) {
  ASSERT_OK_AND_ASSIGN(BlobFinder finder, BlobFinder::Create(TakesAll()));
  Image image(200, 30);
  Paint({10, 10, 8, 4}, &image);
  Paint({150, 10, 8, 4}, &image);
  PixelMask ignored(200, 30);
  for (int y = 0; y < 30; ++y) {
    for (int x = 140; x < 154; ++x) ignored.Set(x, y);
  }
  finder.SetIgnored(ignored);
  for (const PixelRect& window : {image.View().Bounds(), PixelRect{5, 5, 190, 20}}) {
    const BlobResult& found = finder.Find(image.View(), window);
    ASSERT_THAT(found.blobs, SizeIs(2));
    EXPECT_EQ(found.blobs[0].box, (PixelRect{10, 10, 8, 4}));
    EXPECT_EQ(found.blobs[1].box, (PixelRect{154, 10, 4, 4}));
    EXPECT_EQ(PixelsOf(found), 48);
  }
  finder.SetIgnored(PixelMask(100, 12));  // smaller than the image, and nothing in it
  EXPECT_EQ(PixelsOf(finder.Find(image.View())), 64);
  PixelMask larger(400, 60);
  larger.Set(10, 10);
  larger.Set(300, 50);
  finder.SetIgnored(larger);
  EXPECT_EQ(PixelsOf(finder.Find(image.View())), 63);
  EXPECT_EQ(PixelsOf(finder.Find(image.View(), {150, 0, 50, 30})), 32);
  finder.SetIgnored({});
  EXPECT_EQ(PixelsOf(finder.Find(image.View())), 64);
}

// Buffers carry nothing over from one image to the next, of whatever size or format.
TEST(BlobFinder, ForgetsTheLastPicture) {
  ASSERT_OK_AND_ASSIGN(BlobFinder used, BlobFinder::Create(TakesAll()));
  for (int trial = 0; trial < 30; ++trial) {
    const PixelFormat format = trial % 3 == 0 ? PixelFormat::kMono8 : PixelFormat::kBgr8;
    Image image(1 + 37 * trial % 211, 1 + 13 * trial % 40, format);
    FillRandomly(static_cast<uint32_t>(100 + trial), trial % 4 == 0 ? 0 : 0.4, &image);
    ASSERT_OK_AND_ASSIGN(BlobFinder fresh, BlobFinder::Create(TakesAll()));
    const BlobResult& a = used.Find(image.View());
    const BlobResult& b = fresh.Find(image.View());
    ASSERT_EQ(a.blobs.size(), b.blobs.size());
    for (size_t i = 0; i < a.blobs.size(); ++i) {
      EXPECT_EQ(a.blobs[i].centre_px, b.blobs[i].centre_px);
      EXPECT_EQ(a.blobs[i].second_moment_px2, b.blobs[i].second_moment_px2);
      EXPECT_EQ(a.blobs[i].box, b.blobs[i].box);
    }
  }
}

}  // namespace
}  // namespace rigcal::agent::blob_finder_test
