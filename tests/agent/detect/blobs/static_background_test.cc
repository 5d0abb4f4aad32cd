// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/static_background.h"

#include <algorithm>
#include <vector>

#include "tests/testing/status_matchers.h"

namespace rigcal::agent::static_background_test {
namespace {

using ::rigcal::testing::StatusIs;

constexpr int kWidth = 200, kHeight = 90;
constexpr int64_t kStepNs = 100'000'000;

// A dark image with orange rectangles.
class Scene {
 public:
  Scene() : pixels_(static_cast<size_t>(kWidth * kHeight * 3), 20) {}
  void Fill(const PixelRect& part, uint8_t b, uint8_t g, uint8_t r) {
    for (int y = part.y; y < part.y + part.height; ++y) {
      for (int x = part.x; x < part.x + part.width; ++x) {
        uint8_t* const pixel = &pixels_[static_cast<size_t>((y * kWidth + x) * 3)];
        pixel[0] = b, pixel[1] = g, pixel[2] = r;
      }
    }
  }
  void Orange(const PixelRect& part) { Fill(part, 30, 110, 220); }
  ImageView View() const { return {pixels_.data(), kWidth, kHeight, kWidth * 3}; }

 private:
  std::vector<uint8_t> pixels_;
};

StaticBackground Make(double after_s = 1.2) {
  auto background = StaticBackground::Create({}, kWidth, kHeight, after_s);
  EXPECT_THAT(background, ::rigcal::testing::IsOk());
  return *std::move(background);
}

// Pixels of row `y` that are left of a mask in which all are set.
int Left(StaticBackground& background, const Scene& scene, int y) {
  std::vector<uint64_t> words((kWidth + 63) / 64, ~uint64_t{0});
  background.BeginImage();
  background.Remove(scene.View(), y, 0, static_cast<int>(words.size()), words.data());
  int count = 0;
  for (int x = 0; x < kWidth; ++x)
    count += (words[static_cast<size_t>(x / 64)] >> (x % 64) & 1) != 0 ? 1 : 0;
  return count;
}

// `count` frames from `*now_ns` on.
void Watch(const Scene& scene, int count, int64_t* now_ns, StaticBackground* background,
           const std::vector<PixelRect>& kept = {}) {
  for (int i = 0; i < count; ++i, *now_ns += kStepNs) {
    background->Learn(scene.View(), *now_ns, kept);
  }
}

TEST(StaticBackground, RemovesWhatStaysWhereItIs) {
  StaticBackground background = Make();
  Scene scene;
  scene.Orange({50, 30, 40, 20});
  int64_t now_ns = 0;
  Watch(scene, 8, &now_ns, &background);
  EXPECT_EQ(Left(background, scene, 40), kWidth);
  Watch(scene, 8, &now_ns, &background);
  EXPECT_EQ(Left(background, scene, 40), kWidth - 40);
  EXPECT_EQ(Left(background, scene, 60), kWidth);
  EXPECT_EQ(background.pixel_count(), 800);
}

TEST(StaticBackground, LeavesWhatIsInFrontOfItAndWhatTakesItsPlace) {
  StaticBackground background = Make();
  Scene scene;
  scene.Orange({50, 30, 40, 20});
  int64_t now_ns = 0;
  Watch(scene, 20, &now_ns, &background);
  Scene covered = scene;
  covered.Fill({60, 30, 10, 20}, 60, 190, 255);
  EXPECT_EQ(Left(background, covered, 40), kWidth - 30);
  Scene gone;
  EXPECT_EQ(Left(background, gone, 40), kWidth);
  // It comes back as it was, if it was away for a moment only.
  Watch(gone, 2, &now_ns, &background);
  EXPECT_EQ(Left(background, scene, 40), kWidth - 40);
  Watch(gone, 10, &now_ns, &background);
  EXPECT_EQ(Left(background, scene, 40), kWidth);
  EXPECT_EQ(background.pixel_count(), 0);
}

TEST(StaticBackground, LearnsNothingOfWhatMoves) {
  StaticBackground background = Make();
  int64_t now_ns = 0;
  for (int i = 0; i < 40; ++i) {
    Scene scene;
    scene.Orange({3 * i, 30, 12, 12});
    Watch(scene, 1, &now_ns, &background);
  }
  EXPECT_EQ(background.pixel_count(), 0);
}

TEST(StaticBackground, KeepsPartsAsTheyAre) {
  StaticBackground background = Make();
  Scene scene;
  scene.Orange({50, 30, 40, 20});
  int64_t now_ns = 0;
  Watch(scene, 40, &now_ns, &background, {{45, 25, 25, 90}});
  EXPECT_EQ(Left(background, scene, 40), kWidth - 20);
  background.Forget({80, 0, 10, kHeight});
  EXPECT_EQ(Left(background, scene, 40), kWidth - 10);
  EXPECT_EQ(background.pixel_count(), 200);
}

TEST(StaticBackground, ComparesAPart) {
  StaticBackground background = Make();
  Scene scene;
  scene.Orange({50, 30, 40, 20});
  int64_t now_ns = 0;
  Watch(scene, 20, &now_ns, &background);
  scene.Fill({50, 30, 5, 20}, 20, 20, 20);
  const StaticBackground::Pixels pixels = background.Compare(scene.View(), {40, 20, 30, 30});
  EXPECT_EQ(pixels.count, 400);
  EXPECT_EQ(pixels.changed, 100);
}

TEST(StaticBackground, DependsOnTimesAndNotOnTheRate) {
  for (const int64_t step_ns : {int64_t{10'000'000}, int64_t{50'000'000}, int64_t{100'000'000}}) {
    StaticBackground background = Make(2.4);
    Scene scene;
    scene.Orange({50, 30, 40, 20});
    int64_t learnt_ns = 0;
    for (int64_t now_ns = 0; background.pixel_count() < 800; now_ns += step_ns) {
      background.Learn(scene.View(), now_ns, {});
      learnt_ns = now_ns;
      ASSERT_LT(now_ns, 10'000'000'000);
    }
    EXPECT_NEAR(1e-9 * static_cast<double>(learnt_ns), 2.4, 0.3) << step_ns;
  }
}

TEST(StaticBackground, LearnsALargePatchInSpiteOfItsLimitPerFrame) {
  auto background = StaticBackground::Create({}, 1280, 1024, 1.2);
  ASSERT_THAT(background, ::rigcal::testing::IsOk());
  std::vector<uint8_t> pixels(1280 * 1024 * 3);
  for (size_t i = 0; i < pixels.size(); i += 3) {
    pixels[i] = 30, pixels[i + 1] = 110, pixels[i + 2] = 220;
  }
  const ImageView view{pixels.data(), 1280, 1024, 1280 * 3};
  int frames = 0;
  while (background->pixel_count() < 1280 * 1024) {
    background->Learn(view, kStepNs * frames, {});
    ASSERT_LT(++frames, 400);
  }
}

TEST(StaticBackground, RefusesNoTimeAndNoSize) {
  EXPECT_THAT(StaticBackground::Create({}, kWidth, kHeight, 0),
              StatusIs(absl::StatusCode::kInvalidArgument, ::testing::_));
  EXPECT_THAT(StaticBackground::Create({}, 0, kHeight, 1),
              StatusIs(absl::StatusCode::kInvalidArgument, ::testing::_));
}

}  // namespace
}  // namespace rigcal::agent::static_background_test
