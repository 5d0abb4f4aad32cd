// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/answer_limits.h"

#include <algorithm>
#include <string>

#include "common/text/printable.h"

namespace rigcal::server {
namespace {

template <typename Message>
bool Fits(const Message& message) {
  return message.ByteSizeLong() <= kMaxResourceBytes;
}

void Shorten(size_t bytes, std::string* text) {
  if (text->size() > bytes) text->resize(Beginning(*text, bytes).size());
}

template <typename Refusals>
void ShortenExamples(size_t bytes, Refusals* refused) {
  for (auto& refusal : *refused) Shorten(bytes, refusal.mutable_example());
}

// The last `count` are kept.
template <typename Repeated>
void KeepLast(int count, Repeated* elements) {
  if (elements->size() > count) elements->DeleteSubrange(0, elements->size() - count);
}

}  // namespace

void FitAnswer(v1::Session* session) {
  for (const size_t bytes : {64, 0}) {
    if (Fits(*session)) return;
    for (auto& camera : *session->mutable_cameras()) {
      ShortenExamples(bytes, camera.mutable_refused());
    }
  }
  for (const int count : {256, 16, 1}) {
    if (Fits(*session)) return;
    for (auto& camera : *session->mutable_cameras()) {
      KeepLast(count, camera.mutable_clock_epochs());
      KeepLast(count, camera.mutable_streams());
    }
  }
}

void FitAnswer(v1::Calibration* calibration) {
  // What the request brought is for the solve.
  if (calibration->options().has_origin()) {
    calibration->mutable_options()->mutable_origin()->clear_measured();
  }
  if (calibration->options().has_scale()) {
    calibration->mutable_options()->mutable_scale()->clear_measured();
  }
  for (const size_t bytes : {64, 0}) {
    if (Fits(*calibration)) return;
    ShortenExamples(bytes, calibration->mutable_refused());
    for (auto& finding : *calibration->mutable_findings()) {
      Shorten(4 * bytes, finding.mutable_advice());
    }
    for (auto& reason : *calibration->mutable_quality()->mutable_reasons()) {
      Shorten(4 * bytes, &reason);
    }
  }
}

}  // namespace rigcal::server
