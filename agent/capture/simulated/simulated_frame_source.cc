// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/simulated/simulated_frame_source.h"

#include <opencv2/imgproc.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/simulation/frames/held_board.h"

namespace rigcal::agent {
namespace {

constexpr double kBoardBlurPx = 0.7, kBoardNoiseGrey = 1.5;  // of a camera that is in focus

}  // namespace

void AddOptions(SimulatedFrameSourceOptions* options, OptionTable* table) {
  AddOptions(static_cast<SimulatedCameraOptions*>(options), table);
  AddNear(&options->held_before, table);
  AddOptions(&options->rendering, table);
}

absl::StatusOr<std::unique_ptr<SimulatedFrameSource>> SimulatedFrameSource::Create(
    SimulatedFrameSourceOptions options) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  RIGCAL_ASSIGN_OR_RETURN(CameraDescription description, DescribeSimulatedCamera(options));
  RIGCAL_RETURN_IF_ERROR(DescribeLens(options, &description));
  absl::StrAppend(&description.source, ";pixels=1");
  description.settings.emplace();
  description.settings->model = "simulated";
  description.settings->pixel_format = "BGR8";
  description.settings->exposure_s = options.rendering.exposure_s;
  return std::make_unique<SimulatedFrameSource>(std::move(options), std::move(description));
}

absl::Status SimulatedFrameSource::Start(const Target& target) {
  renderer_.reset();
  board_renderer_.reset();
  counts_ = {};
  if (!target.board.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(board_, ParseBoard(target.board));
    // Of a board that is held, the world gives the time alone.
    RIGCAL_ASSIGN_OR_RETURN(const Target shown,
                            options_.held_before ? ParseTarget("point") : MakeBoardTarget(board_));
    RIGCAL_RETURN_IF_ERROR(
        StartWorld(target.points.empty() || options_.held_before ? shown : target));
    board_renderer_.emplace(Camera().true_intrinsics, description_.image_size_px);
    bgr_.resize(3 * size_t{description_.image_size_px.width} * description_.image_size_px.height);
    return absl::OkStatus();
  }
  RIGCAL_RETURN_IF_ERROR(CheckIsLine(target));
  RIGCAL_RETURN_IF_ERROR(StartWorld(target));
  RIGCAL_ASSIGN_OR_RETURN(renderer_,
                          FrameRenderer::Create(world_, options_.camera_index, options_.rendering));
  bgr_.resize(renderer_->buffer_size());
  return absl::OkStatus();
}

void SimulatedFrameSource::RenderBoard() {
  const double rig_time_s = world_->FrameRigTime(options_.camera_index, frame_);
  const ImageSize& size = description_.image_size_px;
  const auto seed = options_.simulation.seed + static_cast<uint32_t>(options_.camera_index);
  RigidTransform cam_from_board;
  if (options_.held_before) {
    cam_from_board = HeldBoard(board_, Camera().true_intrinsics, size, rig_time_s, seed);
  } else {
    const WandPose pose = world_->WandAt(rig_time_s);
    cam_from_board =
        Camera().cam_from_rig * RigidTransform{Eigen::Quaterniond(pose.rotation), pose.origin_m};
  }
  const cv::Mat grey =
      board_renderer_->Render(board_, cam_from_board, kBoardBlurPx, kBoardNoiseGrey,
                              (uint64_t{seed} << 32) + static_cast<uint64_t>(frame_));
  cv::Mat bgr(grey.rows, grey.cols, CV_8UC3, bgr_.data());
  cv::cvtColor(grey, bgr, cv::COLOR_GRAY2BGR);
}

absl::StatusOr<std::optional<Frame>> SimulatedFrameSource::Next() {
  if ((!renderer_ && !board_renderer_) || !HasFrame()) return std::nullopt;
  const int64_t time_ns = world_->Observe(options_.camera_index, frame_).time_ns;
  // Rendered before the wait, so that a camera that is fast enough keeps its pace.
  if (board_renderer_) {
    RenderBoard();
  } else {
    RIGCAL_RETURN_IF_ERROR(renderer_->Render(frame_, bgr_).status());
  }
  if (!PassFrame(time_ns)) return std::nullopt;
  ++counts_.received;
  const ImageSize& size = description_.image_size_px;
  return Frame{.image = {.data = bgr_.data(),
                         .width = static_cast<int>(size.width),
                         .height = static_cast<int>(size.height),
                         .stride_bytes = static_cast<ptrdiff_t>(3 * size.width),
                         .format = PixelFormat::kBgr8},
               .time_ns = time_ns,
               .clock_epoch = clock_epochs_.EpochOf(time_ns),
               .exposure_s = options_.rendering.exposure_s};
}

}  // namespace rigcal::agent
