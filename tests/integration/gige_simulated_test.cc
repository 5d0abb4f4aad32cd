// SPDX-License-Identifier: Apache-2.0
// Frames of a simulated camera over the real GigE Vision protocol: the same pixels and times as
// without a network.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "agent/capture/genicam/aravis_frame_source.h"
#include "tests/testing/fake_gige_camera.h"
#include "tests/testing/rendered_frames.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::gige_simulated_test {
namespace {

RenderedFramesOptions SmallWorld(const std::string& pixel_format) {
  RenderedFramesOptions options;
  options.simulation.camera_count = 2;
  options.simulation.duration_s = 1;
  options.simulation.rate_hz = 10;
  options.rendering.lux = 50;
  options.target = *ParseTarget("wand:0,0.13,0.39");
  options.pixel_format = pixel_format;
  options.ahead = 10;  // all of them
  return options;
}

TEST(GigeSimulated, PixelsAndTimesArriveUnchanged) {
  ASSERT_OK_AND_ASSIGN(const auto frames, RenderedFrames::Create(SmallWorld("RGB8")));
  // The expected frames: the same world, rendered here.
  ASSERT_OK_AND_ASSIGN(SimulatedWorld world,
                       SimulatedWorld::Create(SmallWorld("").simulation, SmallWorld("").target));
  const auto shared = std::make_shared<const SimulatedWorld>(std::move(world));
  ASSERT_OK_AND_ASSIGN(FrameRenderer renderer,
                       FrameRenderer::Create(shared, 0, SmallWorld("").rendering));
  std::map<int64_t, int> index_of_time;
  for (int i = 0; i < shared->FrameCount(0); ++i) {
    index_of_time[shared->Observe(0, i).time_ns] = i;
  }

  FakeGigeCameraOptions camera_options;
  camera_options.pixel_format = "RGB8";
  camera_options.width = static_cast<int>(frames->image_size_px().width);
  camera_options.height = static_cast<int>(frames->image_size_px().height);
  camera_options.frame_rate_hz = frames->rate_hz();
  camera_options.fill = [&](uint64_t index, double exposure_s, std::span<uint8_t> pixels) {
    return frames->Take(index, exposure_s, pixels);
  };
  ASSERT_OK_AND_ASSIGN(const auto camera, FakeGigeCamera::Create(camera_options));
  const TemporaryDirectory directory;
  const std::string calibration = directory.path() / "gige.yaml";
  ASSERT_THAT(WriteCameraExport(calibration, frames->Export("gige")), IsOk());

  agent::AravisSourceOptions options;
  options.camera = "gige";
  options.device = "127.0.0.1";
  options.exposure_s = 0.005;
  options.calibration_path = calibration;
  ASSERT_OK_AND_ASSIGN(const auto source, agent::AravisFrameSource::Create(options));
  EXPECT_TRUE(source->description().intrinsics.has_value());
  ASSERT_THAT(source->Start({}), IsOk());
  std::vector<uint8_t> bgr(renderer.buffer_size());
  int compared = 0;
  for (int i = 0; i < 5; ++i) {
    ASSERT_OK_AND_ASSIGN(const auto frame, source->Next());
    ASSERT_TRUE(frame.has_value());
    const auto found = index_of_time.find(frame->time_ns);
    ASSERT_NE(found, index_of_time.end()) << frame->time_ns;
    ASSERT_THAT(renderer.Render(found->second, bgr), IsOk());
    ASSERT_EQ(frame->image.stride_bytes * frame->image.height, static_cast<ptrdiff_t>(bgr.size()));
    EXPECT_TRUE(std::equal(bgr.begin(), bgr.end(), frame->image.data)) << found->second;
    ++compared;
  }
  EXPECT_EQ(compared, 5);
  EXPECT_EQ(frames->late(), 0u);
}

TEST(RenderedFrames, AreBlackWhenLateAndAfterTheEnd) {
  RenderedFramesOptions options = SmallWorld("Mono8");
  options.ahead = 3;
  ASSERT_OK_AND_ASSIGN(const auto frames, RenderedFrames::Create(options));
  const ImageSize size = frames->image_size_px();
  std::vector<uint8_t> pixels(size_t{size.width} * size.height, 77);
  const int64_t first_ns = frames->Take(0, 0, pixels);
  EXPECT_GT(*std::max_element(pixels.begin(), pixels.end()), 100);
  EXPECT_EQ(frames->late(), 0u);
  // Frame 9 is not among the first ones rendered.
  const int64_t last_ns = frames->Take(9, 0, pixels);
  EXPECT_EQ(*std::max_element(pixels.begin(), pixels.end()), 0);
  EXPECT_EQ(frames->late(), 1u);
  EXPECT_NEAR(static_cast<double>(last_ns - first_ns), 0.9e9, 1e3);
  const int64_t after_ns = frames->Take(12, 0.004, pixels);
  EXPECT_NEAR(static_cast<double>(after_ns - last_ns), 0.3e9 - 0.002e9, 1e3);
  EXPECT_EQ(*std::max_element(pixels.begin(), pixels.end()), 0);
  EXPECT_EQ(frames->late(), 1u);
}

TEST(RenderedFrames, RefuseAMissingCamera) {
  RenderedFramesOptions options = SmallWorld("Mono8");
  options.camera_index = 7;
  EXPECT_FALSE(RenderedFrames::Create(options).ok());
}

TEST(EncodeImage, PutsEachColourWhereTheSensorHasIt) {
  const std::vector<uint8_t> bgr{1, 2, 3, 1, 2, 3, 1, 2, 3, 1, 2, 3};  // 2 x 2
  const std::map<std::string, std::vector<uint8_t>> expected{{"BayerRG8", {3, 2, 2, 1}},
                                                             {"BayerGR8", {2, 3, 1, 2}},
                                                             {"BayerGB8", {2, 1, 3, 2}},
                                                             {"BayerBG8", {1, 2, 2, 3}}};
  for (const auto& [format, mosaic] : expected) {
    std::vector<uint8_t> pixels(4);
    EncodeImage(format, bgr, 2, pixels);
    EXPECT_EQ(pixels, mosaic) << format;
  }
  std::vector<uint8_t> rgb(12);
  EncodeImage("RGB8", bgr, 2, rgb);
  EXPECT_THAT(rgb, ::testing::ElementsAre(3, 2, 1, 3, 2, 1, 3, 2, 1, 3, 2, 1));
}

}  // namespace
}  // namespace rigcal::testing::gige_simulated_test
