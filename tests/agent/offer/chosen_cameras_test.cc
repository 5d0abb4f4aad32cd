// SPDX-License-Identifier: Apache-2.0
#include "agent/offer/chosen_cameras.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::chosen_cameras_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;

ChosenCamera Camera(const std::string& device, const std::string& name) {
  return {.device = device,
          .kind = "aravis",
          .source = "aravis:" + device,
          .camera = name,
          .vendor = "FLIR",
          .model = "Blackfly"};
}

class ChosenCamerasTest : public ::testing::Test {
 protected:
  absl::StatusOr<ChosenCameras> Open() { return ChosenCameras::Open(folder_.path()); }
  const testing::TemporaryDirectory folder_;
};

TEST_F(ChosenCamerasTest, KeepsThemWithTheirLensesUntilTheyAreRemoved) {
  ASSERT_OK_AND_ASSIGN(ChosenCameras chosen, Open());
  EXPECT_TRUE(chosen.cameras().empty());
  ChosenCamera left = Camera("21876543", "left");
  left.has_lens = true;
  ASSERT_THAT(chosen.WriteLens("left", "%YAML:1.0\n"), IsOk());
  ASSERT_THAT(chosen.Add(left), IsOk());
  ASSERT_THAT(chosen.Add(Camera("7\n\xff", "right")), IsOk());

  ASSERT_OK_AND_ASSIGN(ChosenCameras again, Open());
  ASSERT_EQ(again.cameras().size(), 2u);
  EXPECT_EQ(again.cameras()[0], left);
  ASSERT_NE(again.FindDevice("21876543"), nullptr);
  EXPECT_EQ(again.FindDevice("21876543")->camera, "left");
  ASSERT_NE(again.FindCamera("right"), nullptr);
  EXPECT_EQ(again.FindCamera("top"), nullptr);
  EXPECT_TRUE(std::filesystem::exists(again.LensPath("left")));

  ASSERT_THAT(again.Remove("left"), IsOk());
  EXPECT_FALSE(std::filesystem::exists(again.LensPath("left")));
  EXPECT_THAT(again.Remove("left"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("left")));
  ASSERT_OK_AND_ASSIGN(const ChosenCameras last, Open());
  ASSERT_EQ(last.cameras().size(), 1u);
  EXPECT_EQ(last.cameras()[0].camera, "right");
}

TEST_F(ChosenCamerasTest, RefusesADeviceOrANameTwice) {
  ASSERT_OK_AND_ASSIGN(ChosenCameras chosen, Open());
  ASSERT_THAT(chosen.Add(Camera("1", "left")), IsOk());
  EXPECT_THAT(chosen.Add(Camera("1", "right")),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("is camera left")));
  EXPECT_THAT(chosen.Add(Camera("2", "left")),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("camera left")));
  EXPECT_EQ(chosen.cameras().size(), 1u);
}

TEST_F(ChosenCamerasTest, NamesADamagedFileAndWhatToDo) {
  const std::string entry =
      R"({"device":"1","kind":"aravis","source":"aravis:1","camera":"NAME","vendor":"","model":"","has_lens":false})";
  const auto with = [&](const std::string& name) {
    return std::string(entry).replace(entry.find("NAME"), 4, name);
  };
  for (const std::string& text :
       {std::string("{"), std::string("[]"), std::string(R"({"cameras":[{"device":"1"}]})"),
        "{\"cameras\":[" + with("../x") + "]}",
        "{\"cameras\":[" + with("left") + "," + with("left") + "]}"}) {
    folder_.WriteFile("cameras.json", text);
    EXPECT_THAT(Open(), StatusIs(absl::StatusCode::kDataLoss,
                                 AllOf(HasSubstr("cameras.json is damaged"), HasSubstr("remove"))))
        << text;
  }
}

TEST_F(ChosenCamerasTest, ChangesNothingWhereItCannotBeWritten) {
  ASSERT_OK_AND_ASSIGN(ChosenCameras chosen, Open());
  ASSERT_THAT(chosen.Add(Camera("1", "left")), IsOk());
  std::filesystem::remove_all(folder_.path());
  EXPECT_THAT(chosen.Add(Camera("2", "right")),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("cameras.json")));
  EXPECT_FALSE(chosen.Remove("left").ok());
  EXPECT_EQ(chosen.cameras().size(), 1u);
}

}  // namespace
}  // namespace rigcal::agent::chosen_cameras_test
