// SPDX-License-Identifier: Apache-2.0
#include "agent/offer/camera_offers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::camera_offers_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;

constexpr std::chrono::seconds kLongest{60};

// An agent with two simulated cameras to offer, whose changes the test makes.
class CameraOffersTest : public ::testing::Test {
 protected:
  void Make(std::vector<ConfiguredCamera> configured = {}, int simulated = 2) {
    offers_.reset();
    absl::StatusOr<ChosenCameras> chosen = ChosenCameras::Open(folder_.path());
    ASSERT_THAT(chosen.status(), IsOk());
    CameraOffersOptions options;
    options.scan = {.devices = false, .simulated_count = simulated};
    options.scan_interval = std::chrono::milliseconds(20);
    offers_ = std::make_unique<CameraOffers>(options, *std::move(chosen), std::move(configured));
  }
  void Start() {
    offers_->Start(
        [this] {
          const std::lock_guard lock(mutex_);
          ++news_;
          changed_.notify_all();
        },
        [this] { return capturing_.load(); });
  }
  // What `take` gives once it gives something; none after a minute.
  template <typename Take>
  auto Await(Take take) -> decltype(take()) {
    const auto give_up = std::chrono::steady_clock::now() + kLongest;
    std::unique_lock lock(mutex_);
    while (true) {
      const int before = news_;
      lock.unlock();
      if (auto taken = take()) return taken;
      lock.lock();
      if (!changed_.wait_until(lock, give_up, [&] { return news_ != before; })) return {};
    }
  }
  absl::Status Ask(const std::string& device, const std::string& camera,
                   const std::string& lens = "", const absl::Status& outcome = absl::OkStatus()) {
    offers_->Request({.request_id = ++request_id_,
                      .device = device,
                      .camera = camera,
                      .calibration_yaml = lens});
    const auto answer = Await([&] {
      if (auto change = offers_->TakeChange()) {
        made_.push_back(change->added ? "+" + change->added->description().camera
                                      : "-" + change->dropped);
        offers_->Settle(outcome);
      }
      return offers_->TakeAnswer();
    });
    if (!answer) return absl::DeadlineExceededError("there is no answer");
    EXPECT_EQ(answer->request_id, request_id_);
    return answer->status;
  }
  // "sim-0 free -, sim-1 takes part left" once it is so; else what it was last.
  std::string AwaitOffer(const std::string& wanted) {
    std::string last;
    Await([&]() -> std::optional<bool> {
      if (const auto offer = offers_->TakeOffer()) {
        last.clear();
        for (const OfferedCamera& camera : *offer) {
          absl::StrAppend(&last, last.empty() ? "" : ", ", camera.device, " ", NameOf(camera.use),
                          " ", camera.camera.empty() ? "-" : camera.camera,
                          camera.configured ? " configured" : "");
          note_ = camera.note.empty() ? note_ : camera.note;
        }
      }
      return last == wanted ? std::optional(true) : std::nullopt;
    });
    return last;
  }

  const testing::TemporaryDirectory folder_;
  std::mutex mutex_;
  std::condition_variable changed_;
  int news_ = 0;
  std::atomic<bool> capturing_ = false;
  uint32_t request_id_ = 0;
  std::vector<std::string> made_;  // changes
  std::string note_;               // the last one offered
  std::unique_ptr<CameraOffers> offers_;
};

TEST_F(CameraOffersTest, UsesKeepsAndDrops) {
  Make();
  EXPECT_TRUE(offers_->OpenChosen().empty());
  Start();
  EXPECT_EQ(AwaitOffer("sim-0 free -, sim-1 free -"), "sim-0 free -, sim-1 free -");
  ASSERT_THAT(Ask("sim-1", "left"), IsOk());
  EXPECT_EQ(AwaitOffer("sim-0 free -, sim-1 takes part left"),
            "sim-0 free -, sim-1 takes part left");
  EXPECT_THAT(Ask("sim-1", "left"), IsOk()) << "nothing is left to do";
  EXPECT_THAT(made_, ::testing::ElementsAre("+left"));

  // A start of the agent.
  Make();
  const auto sources = offers_->OpenChosen();
  ASSERT_EQ(sources.size(), 1u);
  EXPECT_EQ(sources[0]->description().camera, "left");
  Start();
  EXPECT_EQ(AwaitOffer("sim-0 free -, sim-1 takes part left"),
            "sim-0 free -, sim-1 takes part left");
  ASSERT_THAT(Ask("", "left"), IsOk());
  EXPECT_EQ(AwaitOffer("sim-0 free -, sim-1 free -"), "sim-0 free -, sim-1 free -");
  Make();
  EXPECT_TRUE(offers_->OpenChosen().empty());
}

TEST_F(CameraOffersTest, RefusesWithWhatToDo) {
  Make({{.camera = "fixed", .source = "aravis:1"}});
  Start();
  EXPECT_THAT(Ask("7", "left"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("sim-0, sim-1")));
  EXPECT_THAT(Ask("sim-0", "fixed"),
              StatusIs(absl::StatusCode::kAlreadyExists,
                       AllOf(HasSubstr("fixed"), HasSubstr("another name"))));
  EXPECT_THAT(Ask("", "fixed"), StatusIs(absl::StatusCode::kFailedPrecondition,
                                         HasSubstr("configuration or command line")));
  EXPECT_THAT(Ask("", "left"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("there is none")));
  EXPECT_THAT(Ask("sim-0", "left", "no lens"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("the lens file")));
  capturing_ = true;
  EXPECT_THAT(Ask("sim-0", "left"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("next session")));
  capturing_ = false;
  // The uplink may refuse, too: nothing is kept then.
  EXPECT_THAT(Ask("sim-0", "left", "", absl::FailedPreconditionError("not now")),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("not now")));
  ASSERT_THAT(Ask("sim-0", "left"), IsOk());
  EXPECT_THAT(Ask("sim-0", "right"),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("takes part as 'left'")));
  EXPECT_THAT(Ask("sim-1", "left"),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("is device sim-0's")));
  capturing_ = true;
  EXPECT_THAT(Ask("", "left"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("when it has stopped")));
  capturing_ = false;
  EXPECT_THAT(Ask("", "left", "", absl::FailedPreconditionError("rows wait")),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("rows wait")));
  EXPECT_EQ(AwaitOffer("sim-0 takes part left, sim-1 free -"),
            "sim-0 takes part left, sim-1 free -");
}

TEST_F(CameraOffersTest, SaysThatAChoiceCannotBeKept) {
  Make();
  Start();
  AwaitOffer("sim-0 free -, sim-1 free -");
  std::filesystem::remove_all(folder_.path());
  EXPECT_THAT(Ask("sim-0", "left"),
              StatusIs(absl::StatusCode::kInternal, HasSubstr("until the agent ends")));
}

TEST_F(CameraOffersTest, TheConfigurationWinsAndItIsSaid) {
  Make();
  Start();
  ASSERT_THAT(Ask("sim-0", "left"), IsOk());
  Make({{.camera = "left", .source = "aravis:1"}});
  EXPECT_TRUE(offers_->OpenChosen().empty());
  Start();
  EXPECT_EQ(AwaitOffer("sim-0 free left, sim-1 free -"), "sim-0 free left, sim-1 free -");
  EXPECT_THAT(note_, AllOf(HasSubstr("this name to another camera"), HasSubstr("drop left")));
  ASSERT_THAT(Ask("", "left"), IsOk());
  EXPECT_EQ(AwaitOffer("sim-0 free -, sim-1 free -"), "sim-0 free -, sim-1 free -");
}

// Aravis' fake camera stands for one that is unplugged at the start.
TEST_F(CameraOffersTest, ACameraThatWasGoneComesBackByItself) {
  {
    absl::StatusOr<ChosenCameras> chosen = ChosenCameras::Open(folder_.path());
    ASSERT_THAT(chosen.status(), IsOk());
    ASSERT_THAT(chosen->Add({.device = "no-such-camera",
                             .kind = "aravis",
                             .source = "aravis:no-such-camera",
                             .camera = "left"}),
                IsOk());
    ASSERT_THAT(chosen->WriteLens("right", "damaged"), IsOk());
    ASSERT_THAT(chosen->Add({.device = "sim-0",
                             .kind = "sim",
                             .source = "sim:camera=0",
                             .camera = "right",
                             .has_lens = true}),
                IsOk());
  }
  Make();
  EXPECT_TRUE(offers_->OpenChosen().empty());
  Start();
  const std::string gone = "no-such-camera gone left, sim-0 free right, sim-1 free -";
  EXPECT_EQ(AwaitOffer(gone), gone);
  // What kept it away has gone.
  std::filesystem::remove(folder_.path() / "lenses" / "right.yaml");
  const std::string lens =
      "%YAML:1.0\n---\nimage_width: 1280\nimage_height: 1024\ncamera_matrix: !!opencv-matrix\n"
      "   rows: 3\n   cols: 3\n   dt: d\n   data: [ 900., 0., 640., 0., 900., 512., 0., 0., 1. ]\n"
      "distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n"
      "   data: [ 0., 0., 0., 0., 0. ]\n";
  folder_.WriteFile("lenses/right.yaml", lens);
  const auto change = Await([&] { return offers_->TakeChange(); });
  ASSERT_TRUE(change && change->added);
  EXPECT_EQ(change->added->description().camera, "right");
  offers_->Settle(absl::OkStatus());
  const std::string back = "no-such-camera gone left, sim-0 takes part right, sim-1 free -";
  EXPECT_EQ(AwaitOffer(back), back);
}

TEST_F(CameraOffersTest, OffersEverythingAgainToANewConnection) {
  Make();
  Start();
  EXPECT_EQ(AwaitOffer("sim-0 free -, sim-1 free -"), "sim-0 free -, sim-1 free -");
  EXPECT_FALSE(offers_->TakeOffer().has_value());
  offers_->Forget();
  EXPECT_TRUE(offers_->TakeOffer().has_value());
}

}  // namespace
}  // namespace rigcal::agent::camera_offers_test
