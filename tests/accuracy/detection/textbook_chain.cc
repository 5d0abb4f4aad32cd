// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/textbook_chain.h"

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>

#include "tests/testing/textbook_events.h"

namespace rigcal::accuracy {

struct TextbookChain::Impl {
  testing::TextbookBlinkFilter filter;
  cv::Ptr<cv::SimpleBlobDetector> detector = testing::TextbookBlobDetector();
};

TextbookChain::TextbookChain(agent::SensorGeometry geometry, double blink_hz, double band_rel)
    : impl_(new Impl{testing::TextbookBlinkFilter(geometry, blink_hz, band_rel)}) {}
TextbookChain::~TextbookChain() = default;

void TextbookChain::Take(std::span<const agent::CdEvent> events) {
  for (const agent::CdEvent& event : events) {
    impl_->filter.Event(event.x, event.y, event.on, static_cast<uint32_t>(event.time_us));
  }
}

std::vector<Eigen::Vector2d> TextbookChain::BlobsPx(int64_t time_us) const {
  cv::Mat1b image;
  impl_->filter.Image(static_cast<uint32_t>(time_us), &image);
  std::vector<cv::KeyPoint> keypoints;
  impl_->detector->detect(image, keypoints);
  std::vector<Eigen::Vector2d> blobs;
  for (const cv::KeyPoint& keypoint : keypoints) blobs.emplace_back(keypoint.pt.x, keypoint.pt.y);
  return blobs;
}

}  // namespace rigcal::accuracy
