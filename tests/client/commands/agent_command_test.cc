// SPDX-License-Identifier: Apache-2.0
#include "client/commands/agent_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/client/command_runner.h"
#include "tests/client/fake_server.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::client::agent_command_test {
namespace {

using nlohmann::json;
using ::rigcal::testing::CommandOutcome;
using ::rigcal::testing::FakeServer;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class AgentPreviewCommand : public ::testing::Test {
 protected:
  AgentPreviewCommand() {
    fake_.preview.set_rig("lab");
    fake_.preview.set_jpeg(std::string("\xff\xd8\0jpeg", 7));
    v1::PreviewInfo* info = fake_.preview.mutable_info();
    info->set_camera("left");
    info->mutable_image_size_px()->set_width(1280);
    info->mutable_image_size_px()->set_height(1024);
    info->mutable_jpeg_size_px()->set_width(640);
    info->mutable_jpeg_size_px()->set_height(512);
    info->set_outcome(v1::DETECTION_OUTCOME_TOO_MANY_BLOBS);
    info->set_blob_count(700);
  }

  CommandOutcome Preview(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), {"agent", "preview"});
    arguments.insert(arguments.end(), {"--server", fake_.address()});
    return rigcal::testing::Rigcal(arguments);
  }
  std::string Path(const std::string& name) const { return (directory_.path() / name).string(); }
  static std::string Content(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  FakeServer fake_;
  TemporaryDirectory directory_;
};

TEST_F(AgentPreviewCommand, WritesThePictureAndSaysWhatItShows) {
  const std::string file = Path("now.jpg");
  const CommandOutcome outcome = Preview({"left", "--rig", "lab", "--output", file});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(Content(file), fake_.preview.jpeg());
  EXPECT_EQ(fake_.asked_preview.camera(), "left");
  EXPECT_EQ(fake_.asked_preview.rig(), "lab");
  EXPECT_THAT(outcome.out, AllOf(HasSubstr(file), HasSubstr("lab/left"), HasSubstr("640x512"),
                                 HasSubstr("too many blobs"), HasSubstr("700 blobs")));
}

TEST_F(AgentPreviewCommand, JsonHasEverythingButThePicture) {
  const CommandOutcome outcome = Preview({"left", "--output", Path("a.jpg"), "-o", "json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const json meta = json::parse(outcome.out);
  EXPECT_EQ(meta.at("info").at("outcome"), "DETECTION_OUTCOME_TOO_MANY_BLOBS");
  EXPECT_EQ(meta.at("jpeg"), "");
  EXPECT_EQ(Content(Path("a.jpg")), fake_.preview.jpeg());
}

TEST_F(AgentPreviewCommand, IsNamedAfterTheCamera) {
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(directory_.path());
  const CommandOutcome outcome = Preview({"left"});
  std::filesystem::current_path(before);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(Content(Path("left.jpg")), fake_.preview.jpeg());
}

TEST_F(AgentPreviewCommand, ARefusalWritesNothing) {
  fake_.failures["GetPreview"] = {grpc::StatusCode::NOT_FOUND, "no agent has a camera 'top'"};
  const CommandOutcome outcome = Preview({"top", "--output", Path("top.jpg")});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.out, IsEmpty());
  EXPECT_THAT(outcome.err, HasSubstr("no agent has a camera 'top'"));
  EXPECT_FALSE(std::filesystem::exists(Path("top.jpg")));
}

TEST_F(AgentPreviewCommand, SaysWhenTheServerIsTooOld) {
  fake_.failures["GetPreview"] = {grpc::StatusCode::UNIMPLEMENTED, ""};
  const CommandOutcome outcome = Preview({"left", "--output", Path("a.jpg")});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("rigcal doctor compares the versions"));
}

TEST_F(AgentPreviewCommand, SaysWhyTheFileCannotBeWritten) {
  const CommandOutcome outcome = Preview({"left", "--output", Path("nowhere/a.jpg")});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("nowhere/a.jpg"), HasSubstr("--output")));
  EXPECT_THAT(outcome.out, IsEmpty());
}

TEST_F(AgentPreviewCommand, WantsACamera) { EXPECT_EQ(Preview({}).exit_code, 2); }

}  // namespace
}  // namespace rigcal::client::agent_command_test
