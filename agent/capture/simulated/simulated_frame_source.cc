// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/simulated/simulated_frame_source.h"

#include <utility>

#include "absl/strings/str_cat.h"

namespace rigcal::agent {

void AddOptions(SimulatedFrameSourceOptions* options, OptionTable* table) {
  AddOptions(static_cast<SimulatedCameraOptions*>(options), table);
  AddOptions(&options->rendering, table);
}

absl::StatusOr<std::unique_ptr<SimulatedFrameSource>> SimulatedFrameSource::Create(
    SimulatedFrameSourceOptions options) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  RIGCAL_ASSIGN_OR_RETURN(CameraDescription description, DescribeSimulatedCamera(options));
  absl::StrAppend(&description.source, ";pixels=1");
  description.settings.emplace();
  description.settings->model = "simulated";
  description.settings->pixel_format = "BGR8";
  description.settings->exposure_s = options.rendering.exposure_s;
  return std::make_unique<SimulatedFrameSource>(std::move(options), std::move(description));
}

absl::Status SimulatedFrameSource::Start(const Target& target) {
  renderer_.reset();
  RIGCAL_RETURN_IF_ERROR(CheckIsLine(target));
  RIGCAL_RETURN_IF_ERROR(StartWorld(target));
  RIGCAL_ASSIGN_OR_RETURN(renderer_,
                          FrameRenderer::Create(world_, options_.camera_index, options_.rendering));
  bgr_.resize(renderer_->buffer_size());
  counts_ = {};
  return absl::OkStatus();
}

absl::StatusOr<std::optional<Frame>> SimulatedFrameSource::Next() {
  if (!renderer_ || !HasFrame()) return std::nullopt;
  const int64_t time_ns = world_->Observe(options_.camera_index, frame_).time_ns;
  // Rendered before the wait, so that a camera that is fast enough keeps its pace.
  RIGCAL_RETURN_IF_ERROR(renderer_->Render(frame_, bgr_).status());
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
