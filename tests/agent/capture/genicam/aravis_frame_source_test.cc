// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/aravis_frame_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ringbuffer_sink.h>
#include <spdlog/spdlog.h>

#include <fstream>
#include <future>
#include <thread>

#include "absl/strings/str_join.h"
#include "tests/testing/fake_gige_camera.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::aravis_frame_source_test {
namespace {

using ::rigcal::testing::FakeGigeCamera;
using ::rigcal::testing::FakeGigeCameraOptions;
using ::rigcal::testing::FillTestImage;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::rigcal::testing::TestImageIndex;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr int64_t kMs = 1'000'000;
constexpr std::chrono::seconds kHangs(60);  // far more than anything here takes

FakeGigeCameraOptions SmallCamera() {
  FakeGigeCameraOptions options;
  options.width = 64;
  options.height = 48;
  options.frame_rate_hz = 200;
  options.exposure_s = 0.004;
  return options;
}

AravisSourceOptions OnLoopback() {
  AravisSourceOptions options;
  options.camera = "left";
  options.device = "127.0.0.1";
  options.network_interface = "lo";
  return options;
}

std::unique_ptr<FakeGigeCamera> Serve(const FakeGigeCameraOptions& options) {
  auto camera = FakeGigeCamera::Create(options);
  EXPECT_THAT(camera, IsOk());
  return camera.ok() ? *std::move(camera) : nullptr;
}

std::span<const uint8_t> Pixels(const Frame& frame) {
  return {frame.image.data,
          static_cast<size_t>(frame.image.stride_bytes) * static_cast<size_t>(frame.image.height)};
}

// The next `count` frames' times; fails the test if they do not come.
std::vector<Frame> Take(AravisFrameSource* source, int count) {
  std::vector<Frame> frames;
  for (int i = 0; i < count; ++i) {
    auto next = source->Next();
    EXPECT_THAT(next, IsOk());
    if (!next.ok() || !next->has_value()) break;
    frames.push_back(**next);
  }
  EXPECT_EQ(frames.size(), static_cast<size_t>(count));
  return frames;
}

// Ends the capture, so that everything that was sent is counted.
void End(AravisFrameSource* source) {
  source->Stop();
  const auto next = source->Next();
  ASSERT_THAT(next, IsOk());
  EXPECT_FALSE(next->has_value());
}

uint64_t Sum(const FrameCounts& counts) { return counts.received + counts.damaged + counts.lost; }

TEST(AravisFrameSource, YieldsTheCamerasFrames) {
  const auto camera = Serve(SmallCamera());
  ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(OnLoopback()));
  ASSERT_THAT(source->Start({}), IsOk());
  std::optional<uint64_t> last;
  int64_t last_ns = 0;
  for (int i = 0; i < 40; ++i) {
    ASSERT_OK_AND_ASSIGN(const auto frame, source->Next());
    ASSERT_TRUE(frame.has_value());
    EXPECT_EQ(frame->image.width, 64);
    EXPECT_EQ(frame->image.height, 48);
    EXPECT_EQ(frame->image.format, PixelFormat::kMono8);
    EXPECT_EQ(frame->clock_epoch, 0u);
    const auto index = TestImageIndex(Pixels(*frame));
    ASSERT_TRUE(index.has_value());
    if (last) {
      EXPECT_GT(*index, *last);
      EXPECT_GT(frame->time_ns, last_ns);
    }
    last = index;
    last_ns = frame->time_ns;
  }
  End(source.get());
  EXPECT_GE(source->counts().received, 40u);
  EXPECT_EQ(Sum(source->counts()), camera->sent());
  EXPECT_EQ(source->counts().reconnects, 0u);
}

TEST(AravisFrameSource, DescribesTheCamera) {
  const auto camera = Serve(SmallCamera());
  AravisSourceOptions options = OnLoopback();
  options.exposure_s = 0.003;
  options.frame_rate_hz = 100;
  options.gain_db = 3;
  options.latency_s = 0.001;
  ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(options));
  const CameraDescription& description = source->description();
  EXPECT_EQ(description.camera, "left");
  EXPECT_EQ(description.image_size_px, (ImageSize{64, 48}));
  EXPECT_EQ(description.sensor, SensorKind::kFrame);
  EXPECT_EQ(description.clock.clock_id, "Aravis-RIGCAL01");
  EXPECT_EQ(description.clock.timebase, "");
  EXPECT_EQ(description.source, "aravis:127.0.0.1");
  EXPECT_EQ(description.latency_s, 0.001);
  ASSERT_TRUE(description.settings.has_value());
  EXPECT_THAT(description.settings->model, AllOf(HasSubstr("Aravis"), HasSubstr("Fake")));
  EXPECT_EQ(description.settings->pixel_format, "Mono8");
  EXPECT_NEAR(description.settings->exposure_s, 0.003, 1e-9);
  EXPECT_NEAR(description.settings->frame_rate_hz, 100, 1e-6);
  EXPECT_NEAR(description.settings->gain_db, 3, 1e-9);
  EXPECT_EQ(description.settings->trigger, "free");
  EXPECT_FALSE(description.settings->ptp);
}

TEST(AravisFrameSource, TimeIsTheMiddleOfTheExposure) {
  FakeGigeCameraOptions camera_options = SmallCamera();
  camera_options.fill = [](uint64_t index, double exposure_s, std::span<uint8_t> pixels) {
    FillTestImage(index, exposure_s, pixels);
    return 1'000'000 * kMs + static_cast<int64_t>(index) * 5 * kMs;
  };
  const auto camera = Serve(camera_options);
  AravisSourceOptions options = OnLoopback();
  options.exposure_s = 0.004;
  ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(options));
  ASSERT_THAT(source->Start({}), IsOk());
  for (int i = 0; i < 5; ++i) {
    ASSERT_OK_AND_ASSIGN(const auto frame, source->Next());
    ASSERT_TRUE(frame.has_value());
    const auto index = TestImageIndex(Pixels(*frame));
    ASSERT_TRUE(index.has_value());
    EXPECT_EQ(frame->time_ns, 1'000'000 * kMs + static_cast<int64_t>(*index) * 5 * kMs + 2 * kMs);
    EXPECT_NEAR(frame->exposure_s, 0.004, 1e-9);
  }
}

TEST(AravisFrameSource, AClockThatGoesBackOpensAnEpoch) {
  FakeGigeCameraOptions camera_options = SmallCamera();
  camera_options.fill = [](uint64_t index, double exposure_s, std::span<uint8_t> pixels) {
    FillTestImage(index, exposure_s, pixels);
    const auto stamp_ns = static_cast<int64_t>(index) * 5 * kMs;
    return index < 10 ? stamp_ns + 9000 * kMs : stamp_ns;
  };
  const auto camera = Serve(camera_options);
  ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(OnLoopback()));
  ASSERT_THAT(source->Start({}), IsOk());
  for (int i = 0; i < 20; ++i) {
    ASSERT_OK_AND_ASSIGN(const auto frame, source->Next());
    ASSERT_TRUE(frame.has_value());
    const auto index = TestImageIndex(Pixels(*frame));
    ASSERT_TRUE(index.has_value());
    EXPECT_EQ(frame->clock_epoch, *index < 10 ? 0u : 1u);
  }
}

TEST(AravisFrameSource, ColourFramesComeAsBgr) {
  for (const char* format : {"BayerRG8", "BayerGB8", "RGB8"}) {
    SCOPED_TRACE(format);
    FakeGigeCameraOptions camera_options = SmallCamera();
    camera_options.pixel_format = format;
    // Red alone: the first sample of RG and RGB, the first one of GB's second row.
    camera_options.fill = [&](uint64_t, double, std::span<uint8_t> pixels) {
      std::fill(pixels.begin(), pixels.end(), uint8_t{0});
      const bool rgb = std::string(format) == "RGB8";
      const size_t first_row = std::string(format) == "BayerGB8" ? 1 : 0;
      for (size_t y = 0; y < 48; ++y) {
        for (size_t x = 0; x < 64; ++x) {
          if (rgb) pixels[3 * (y * 64 + x)] = 200;
          if (!rgb && y % 2 == first_row && x % 2 == 0) pixels[y * 64 + x] = 200;
        }
      }
      return std::nullopt;
    };
    const auto camera = Serve(camera_options);
    ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(OnLoopback()));
    EXPECT_EQ(source->description().settings->pixel_format, format);
    ASSERT_THAT(source->Start({}), IsOk());
    ASSERT_OK_AND_ASSIGN(const auto frame, source->Next());
    ASSERT_TRUE(frame.has_value());
    ASSERT_EQ(frame->image.format, PixelFormat::kBgr8);
    const uint8_t* const pixel = frame->image.Row(20) + 3 * 30;
    EXPECT_EQ(pixel[0], 0);
    EXPECT_EQ(pixel[1], 0);
    EXPECT_EQ(pixel[2], 200);
  }
}

TEST(AravisFrameSource, AnUnsupportedFormatOfTheCameraIsExchanged) {
  FakeGigeCameraOptions camera_options = SmallCamera();
  camera_options.pixel_format = "Mono16";
  const auto camera = Serve(camera_options);
  ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(OnLoopback()));
  EXPECT_EQ(source->description().settings->pixel_format, "RGB8");
}

TEST(AravisFrameSource, RefusesSettingsTheCameraDoesNotHave) {
  const auto camera = Serve(SmallCamera());
  const auto refusal = [&](auto set) {
    AravisSourceOptions options = OnLoopback();
    set(&options);
    const auto source = AravisFrameSource::Create(options);
    EXPECT_EQ(source.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(source.status().message());
  };
  EXPECT_THAT(refusal([](auto* o) { o->pixel_format = "Mono16"; }),
              AllOf(HasSubstr("camera left"), HasSubstr("Mono16 is not supported"),
                    HasSubstr("offers: BayerBG8, "), HasSubstr("supported are: BGR8, RGB8")));
  EXPECT_THAT(refusal([](auto* o) { o->pixel_format = "Mono12"; }),
              HasSubstr("Mono12 is not offered"));
  EXPECT_THAT(refusal([](auto* o) { o->gain_db = 50; }),
              AllOf(HasSubstr("gain is to be 50 dB"), HasSubstr("0 to 10 dB")));
  EXPECT_THAT(refusal([](auto* o) { o->exposure_s = 2e-6; }),
              AllOf(HasSubstr("exposure"), HasSubstr("1e-05 to 10 s")));
  EXPECT_THAT(refusal([](auto* o) { o->trigger = "Line7"; }),
              AllOf(HasSubstr("no trigger Line7"), HasSubstr("Line0, Software")));
  EXPECT_THAT(refusal([](auto* o) { o->ptp = true; }), HasSubstr("has no PTP"));
}

TEST(AravisFrameSource, SoftwareTriggersAskForEachFrame) {
  const auto camera = Serve(SmallCamera());
  AravisSourceOptions options = OnLoopback();
  options.trigger = "software";
  options.frame_rate_hz = 50;
  ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(options));
  EXPECT_EQ(source->description().settings->trigger, "software");
  EXPECT_EQ(source->description().settings->frame_rate_hz, 50);
  ASSERT_THAT(source->Start({}), IsOk());
  Take(source.get(), 10);
  End(source.get());
  EXPECT_EQ(Sum(source->counts()), camera->sent());
}

TEST(AravisFrameSource, IsFoundByIdAndSerialNumber) {
  const auto camera = Serve(SmallCamera());
  for (const char* device : {"Aravis-RIGCAL01", "RIGCAL01"}) {
    AravisSourceOptions options = OnLoopback();
    options.device = device;
    ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(options));
    EXPECT_EQ(source->description().clock.clock_id, "Aravis-RIGCAL01");
    ASSERT_THAT(source->Start({}), IsOk());
    Take(source.get(), 2);
  }
}

TEST(AravisFrameSource, AMissingCameraIsToldWithThoseThatAreThere) {
  const auto camera = Serve(SmallCamera());
  for (const char* device : {"127.0.0.77", "Aravis-OTHER"}) {
    AravisSourceOptions options = OnLoopback();
    options.device = device;
    EXPECT_THAT(AravisFrameSource::Create(options),
                StatusIs(absl::StatusCode::kNotFound,
                         AllOf(HasSubstr("camera left"), HasSubstr(device),
                               HasSubstr("Aravis-RIGCAL01 (Fake, 127.0.0.1)"))));
  }
  AravisSourceOptions options = OnLoopback();
  options.network_interface = "no_such_card";
  EXPECT_THAT(AravisFrameSource::Create(options),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("no_such_card")));
}

TEST(AravisFrameSource, ACameraInUseIsRefused) {
  const auto camera = Serve(SmallCamera());
  ASSERT_OK_AND_ASSIGN(const auto first, AravisFrameSource::Create(OnLoopback()));
  ASSERT_THAT(first->Start({}), IsOk());
  Take(first.get(), 1);
  EXPECT_THAT(AravisFrameSource::Create(OnLoopback()),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("Aravis-RIGCAL01 is held by"), HasSubstr("try again"))));
  Take(first.get(), 2);  // is not disturbed
}

TEST(AravisFrameSource, FramesMustBeAsLargeAsTheIntrinsicsSay) {
  const TemporaryDirectory directory;
  const std::string path = directory.path() / "left.yaml";
  std::ofstream(path) << "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n"
                         "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
                         "   data: [ 500., 0., 32., 0., 500., 24., 0., 0., 1. ]\n"
                         "distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n"
                         "   dt: d\n   data: [ 0., 0., 0., 0., 0. ]\n";
  const auto camera = Serve(SmallCamera());
  AravisSourceOptions options = OnLoopback();
  options.calibration_path = path;
  EXPECT_THAT(AravisFrameSource::Create(options),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("64 x 48"), HasSubstr("640 x 480"), HasSubstr(path))));
  options.calibration_path = directory.path() / "none.yaml";
  EXPECT_THAT(AravisFrameSource::Create(options),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("none.yaml")));
}

// What is logged while it lives.
class LogOf {
 public:
  LogOf() : before_(spdlog::default_logger()) {
    spdlog::set_default_logger(std::make_shared<spdlog::logger>("test", lines_));
  }
  ~LogOf() { spdlog::set_default_logger(before_); }
  // Also while other threads log.
  std::string text() const { return absl::StrJoin(lines_->last_formatted(), ""); }

 private:
  const std::shared_ptr<spdlog::sinks::ringbuffer_sink_mt> lines_ =
      std::make_shared<spdlog::sinks::ringbuffer_sink_mt>(100);
  const std::shared_ptr<spdlog::logger> before_;
};

TEST(AravisFrameSource, WarnsOfExposuresShorterThanABlink) {
  const auto camera = Serve(SmallCamera());
  AravisSourceOptions options = OnLoopback();
  for (const auto& [exposure_s, warned] : {std::pair(0.0019, true), std::pair(0.002, false)}) {
    const LogOf log;
    options.exposure_s = exposure_s;
    ASSERT_THAT(AravisFrameSource::Create(options), IsOk());
    EXPECT_EQ(log.text().find("shorter than one blink") != std::string::npos, warned) << log.text();
  }
}

TEST(AravisFrameSource, StopWakesAWaitingNext) {
  const auto camera = Serve(SmallCamera());
  AravisSourceOptions options = OnLoopback();
  options.trigger = "Line0";  // nobody pulls it
  ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(options));
  EXPECT_EQ(source->description().settings->trigger, "Line0");
  ASSERT_THAT(source->Start({}), IsOk());
  auto next = std::async(std::launch::async, [&] { return source->Next(); });
  source->Stop();
  ASSERT_EQ(next.wait_for(kHangs), std::future_status::ready);
  const auto frame = next.get();
  ASSERT_THAT(frame, IsOk());
  EXPECT_FALSE(frame->has_value());
  EXPECT_FALSE(source->Next()->has_value());
  EXPECT_EQ(camera->sent(), 0u);
}

TEST(AravisFrameSource, YieldsNothingBeforeStart) {
  const auto camera = Serve(SmallCamera());
  ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(OnLoopback()));
  ASSERT_OK_AND_ASSIGN(const auto frame, source->Next());
  EXPECT_FALSE(frame.has_value());
}

TEST(AravisFrameSource, BeginsAgainAfterStop) {
  const auto camera = Serve(SmallCamera());
  ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(OnLoopback()));
  uint64_t sent_before = 0;
  for (int capture = 0; capture < 3; ++capture) {
    ASSERT_THAT(source->Start({}), IsOk());
    Take(source.get(), 5);
    End(source.get());
    EXPECT_EQ(Sum(source->counts()), camera->sent() - sent_before);
    sent_before = camera->sent();
  }
}

TEST(AravisFrameSource, EndsInTheMiddleOfACapture) {
  const auto camera = Serve(SmallCamera());
  for (int i = 0; i < 3; ++i) {
    ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(OnLoopback()));
    ASSERT_THAT(source->Start({}), IsOk());
    Take(source.get(), i);
  }
}

TEST(AravisFrameSource, DamagedFramesAreCountedAndNotYielded) {
  FakeGigeCameraOptions camera_options = SmallCamera();
  camera_options.lost_packet_share = 0.05;  // a frame has 5 packets
  const auto camera = Serve(camera_options);
  for (const bool resend : {true, false}) {
    AravisSourceOptions options = OnLoopback();
    options.packet_resend = resend;
    ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(options));
    const uint64_t sent_before = camera->sent();
    ASSERT_THAT(source->Start({}), IsOk());
    for (int i = 0; i < 60; ++i) {
      ASSERT_OK_AND_ASSIGN(const auto frame, source->Next());
      ASSERT_TRUE(frame.has_value());
      EXPECT_TRUE(TestImageIndex(Pixels(*frame)).has_value());
    }
    End(source.get());
    EXPECT_GT(source->counts().damaged, 0u);
    EXPECT_EQ(Sum(source->counts()), camera->sent() - sent_before);
    const std::vector<Refusal> refused = source->Refused();
    ASSERT_FALSE(refused.empty());
    EXPECT_EQ(refused[0].reason, RefusalReason::kFrameIncomplete);
    EXPECT_EQ(refused[0].count, source->counts().damaged);
  }
}

TEST(AravisFrameSource, FramesThatFindNoBufferAreCountedAsLost) {
  const auto camera = Serve(SmallCamera());
  AravisSourceOptions options = OnLoopback();
  options.buffer_count = 3;
  ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(options));
  ASSERT_THAT(source->Start({}), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto frame, source->Next());
  ASSERT_TRUE(frame.has_value());
  const auto held = TestImageIndex(Pixels(*frame));
  const uint64_t sent = camera->sent();
  while (camera->sent() < sent + 20) std::this_thread::yield();
  EXPECT_EQ(TestImageIndex(Pixels(*frame)), held);  // not written over
  Take(source.get(), 3);
  End(source.get());
  EXPECT_GE(source->counts().lost, 15u);
  // Each frame of which some packets found a buffer is counted as damaged, and its others shift the
  // estimate of the lost ones by less than a frame.
  const uint64_t damaged = source->counts().damaged;
  EXPECT_GE(Sum(source->counts()) + damaged, camera->sent());
  EXPECT_LE(Sum(source->counts()), camera->sent() + damaged);
  std::vector<RefusalReason> reasons;
  for (const Refusal& refusal : source->Refused()) reasons.push_back(refusal.reason);
  EXPECT_THAT(reasons, ::testing::Contains(RefusalReason::kFrameNoBuffer));
}

TEST(AravisFrameSource, ClockIsTakenFromArrivalsWhereItCannotBeRead) {
  FakeGigeCameraOptions camera_options = SmallCamera();
  camera_options.fill = [](uint64_t index, double exposure_s, std::span<uint8_t> pixels) {
    FillTestImage(index, exposure_s, pixels);
    return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1) -
           7'000'000 * kMs;
  };
  const auto camera = Serve(camera_options);
  ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(OnLoopback()));
  ASSERT_THAT(source->Start({}), IsOk());
  Take(source.get(), 3);
  const std::vector<ClockSample> samples = source->TakeClockSamples();
  ASSERT_FALSE(samples.empty());
  EXPECT_GE(samples[0].uncertainty_ns, 1'000'000u);
  // A generous limit: the machine may be busy while a frame waits.
  EXPECT_NEAR(static_cast<double>(samples[0].host_monotonic_ns - samples[0].device_ns), 7e12, 2e9);
  EXPECT_NEAR(static_cast<double>(samples[0].host_utc_ns) * 1e-9,
              static_cast<double>(std::chrono::system_clock::now().time_since_epoch() /
                                  std::chrono::seconds(1)),
              100);
}

// The fake camera's description with a clock that can be latched, and PTP.
std::string CameraWithClock(const TemporaryDirectory& directory) {
  const std::string path = directory.path() / "camera.xml";
  std::ofstream(path) << ::rigcal::testing::FakeCameraXml(R"(
    <Command Name="TimestampLatch"><pValue>LatchRegister</pValue><CommandValue>1</CommandValue>
    </Command>
    <IntReg Name="LatchRegister"><Address>0x400</Address><Length>4</Length>
      <AccessMode>RW</AccessMode><pPort>Device</pPort><Sign>Unsigned</Sign>
      <Endianess>BigEndian</Endianess></IntReg>
    <IntReg Name="TimestampLatchValue"><Address>0x410</Address><Length>8</Length>
      <AccessMode>RO</AccessMode><pPort>Device</pPort><Cachable>NoCache</Cachable>
      <Sign>Unsigned</Sign><Endianess>BigEndian</Endianess></IntReg>
    <Boolean Name="PtpEnable"><pValue>PtpRegister</pValue></Boolean>
    <IntReg Name="PtpRegister"><Address>0x420</Address><Length>4</Length>
      <AccessMode>RW</AccessMode><pPort>Device</pPort><Sign>Unsigned</Sign>
      <Endianess>BigEndian</Endianess></IntReg>
    <Enumeration Name="PtpStatus">
      <EnumEntry Name="Listening"><Value>0</Value></EnumEntry>
      <EnumEntry Name="Slave"><Value>1</Value></EnumEntry>
      <pValue>PtpStatusRegister</pValue></Enumeration>
    <IntReg Name="PtpStatusRegister"><Address>0x424</Address><Length>4</Length>
      <AccessMode>RO</AccessMode><pPort>Device</pPort><Cachable>NoCache</Cachable>
      <Sign>Unsigned</Sign><Endianess>BigEndian</Endianess></IntReg>
    <IntReg Name="PtpGrandmasterClockID"><Address>0x428</Address><Length>8</Length>
      <AccessMode>RO</AccessMode><pPort>Device</pPort><Sign>Unsigned</Sign>
      <Endianess>BigEndian</Endianess></IntReg>
)");
  return path;
}

TEST(AravisFrameSource, ClockIsReadFromTheCameraWhereItCanBe) {
  const TemporaryDirectory directory;
  FakeGigeCameraOptions camera_options = SmallCamera();
  camera_options.genicam_path = CameraWithClock(directory);
  constexpr int64_t kStampNs = int64_t{5} << 32;
  camera_options.fill = [](uint64_t index, double exposure_s, std::span<uint8_t> pixels) {
    FillTestImage(index, exposure_s, pixels);
    return kStampNs + static_cast<int64_t>(index) * 5 * kMs;
  };
  const auto camera = Serve(camera_options);
  camera->WriteRegister(0x410, 5);
  camera->WriteRegister(0x414, 123'456);
  ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(OnLoopback()));
  ASSERT_THAT(source->Start({}), IsOk());
  Take(source.get(), 3);
  const std::vector<ClockSample> samples = source->TakeClockSamples();
  ASSERT_EQ(samples.size(), 1u);
  EXPECT_EQ(samples[0].device_ns, kStampNs + 123'456);
  EXPECT_EQ(camera->ReadRegister(0x400), 1u);  // it was told to latch
  EXPECT_GT(samples[0].uncertainty_ns, 0u);
}

TEST(AravisFrameSource, AClockThatStandsElsewhereIsNotBelieved) {
  const TemporaryDirectory directory;
  FakeGigeCameraOptions camera_options = SmallCamera();
  camera_options.genicam_path = CameraWithClock(directory);
  const auto camera = Serve(camera_options);
  camera->WriteRegister(0x410, 0x7000'0000);
  ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(OnLoopback()));
  ASSERT_THAT(source->Start({}), IsOk());
  Take(source.get(), 3);
  const std::vector<ClockSample> samples = source->TakeClockSamples();
  ASSERT_FALSE(samples.empty());
  for (const ClockSample& sample : samples) {
    EXPECT_EQ(sample.uncertainty_ns, DeviceClock::kArrivalUncertaintyNs);
  }
}

TEST(AravisFrameSource, CamerasUnderPtpShareOneClock) {
  const TemporaryDirectory directory;
  FakeGigeCameraOptions camera_options = SmallCamera();
  camera_options.genicam_path = CameraWithClock(directory);
  const auto camera = Serve(camera_options);
  camera->WriteRegister(0x424, 1);
  camera->WriteRegister(0x42c, 0xabc);
  AravisSourceOptions options = OnLoopback();
  options.ptp = true;
  ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(options));
  EXPECT_EQ(camera->ReadRegister(0x420), 1u);
  EXPECT_TRUE(source->description().settings->ptp);
  EXPECT_EQ(source->description().clock.clock_id, "ptp-abc");
  EXPECT_EQ(source->description().clock.timebase, "ptp");
}

TEST(AravisFrameSource, GoesOnWhenTheCameraIsPluggedInAgain) {
  auto camera = Serve(SmallCamera());
  ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(OnLoopback()));
  ASSERT_THAT(source->Start({}), IsOk());
  const int64_t before_ns = Take(source.get(), 5).back().time_ns;
  camera.reset();
  // Aravis asks once a second whether the camera is there.
  auto next = std::async(std::launch::async, [&] {
    while (true) {
      const auto frame = source->Next();
      if (!frame.ok() || !frame->has_value() || source->counts().reconnects > 0) return frame;
    }
  });
  EXPECT_EQ(next.wait_for(std::chrono::milliseconds(1)), std::future_status::timeout);
  camera = Serve(SmallCamera());
  ASSERT_EQ(next.wait_for(kHangs), std::future_status::ready);
  const auto frame = next.get();
  ASSERT_THAT(frame, IsOk());
  ASSERT_TRUE(frame->has_value());
  EXPECT_GT((*frame)->time_ns, before_ns);
  Take(source.get(), 5);
  EXPECT_EQ(source->counts().reconnects, 1u);
  End(source.get());
}

TEST(AravisFrameSource, StopEndsTheSearchForALostCamera) {
  auto camera = Serve(SmallCamera());
  ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(OnLoopback()));
  ASSERT_THAT(source->Start({}), IsOk());
  Take(source.get(), 2);
  camera.reset();
  const LogOf log;
  auto next = std::async(std::launch::async, [&] {
    auto frame = source->Next();
    while (frame.ok() && frame->has_value()) frame = source->Next();
    return frame;
  });
  const auto deadline = std::chrono::steady_clock::now() + kHangs;
  while (log.text().find("trying to reopen it") == std::string::npos &&
         std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_LT(std::chrono::steady_clock::now(), deadline) << "no search was begun: " << log.text();
  source->Stop();
  ASSERT_EQ(next.wait_for(kHangs), std::future_status::ready);
  EXPECT_FALSE(next.get()->has_value());
}

TEST(AravisFrameSource, AravisCameraWithoutNetworkWorksToo) {
  AravisSourceOptions options;
  options.camera = "fake";
  options.device = "Fake_1";
  options.frame_rate_hz = 100;
  ASSERT_OK_AND_ASSIGN(const auto source, AravisFrameSource::Create(options));
  EXPECT_EQ(source->description().clock.clock_id, "Fake_1");
  EXPECT_EQ(source->description().image_size_px, (ImageSize{512, 512}));
  ASSERT_THAT(source->Start({}), IsOk());
  Take(source.get(), 5);
  End(source.get());
  EXPECT_GE(source->counts().received, 5u);
}

}  // namespace
}  // namespace rigcal::agent::aravis_frame_source_test
