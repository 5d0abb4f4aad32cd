// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glib-object.h>

#include <memory>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "arv.h"

// Ownership of Aravis objects.
namespace rigcal::agent {

struct GObjectDeleter {
  void operator()(gpointer object) const { g_object_unref(object); }
};
template <typename T>
using GObjectPtr = std::unique_ptr<T, GObjectDeleter>;

struct GFreeDeleter {
  void operator()(gconstpointer memory) const { g_free(const_cast<gpointer>(memory)); }
};
// A list of strings that the camera still owns.
using GStringList = std::unique_ptr<const char*, GFreeDeleter>;

// The error of a call of Aravis; reusable once it was read.
class GErrorSlot {
 public:
  GErrorSlot() = default;
  ~GErrorSlot() { g_clear_error(&error_); }
  GErrorSlot(const GErrorSlot&) = delete;
  GErrorSlot& operator=(const GErrorSlot&) = delete;

  // For the next call; clears the previous error.
  GError** out() {
    g_clear_error(&error_);
    return &error_;
  }
  bool ok() const { return error_ == nullptr; }
  std::string message() const { return error_ == nullptr ? "no reason given" : error_->message; }

  // `what`: the operation and the camera.
  absl::Status ToStatus(std::string_view what) const {
    if (ok()) return absl::OkStatus();
    const std::string text = std::string(what) + ": " + message();
    if (error_->domain != ARV_DEVICE_ERROR) return absl::InternalError(text);
    switch (error_->code) {
      case ARV_DEVICE_ERROR_NOT_FOUND:
        return absl::NotFoundError(text);
      case ARV_DEVICE_ERROR_TIMEOUT:
      case ARV_DEVICE_ERROR_NOT_CONNECTED:
      case ARV_DEVICE_ERROR_TRANSFER_ERROR:
        return absl::UnavailableError(text);
      case ARV_DEVICE_ERROR_NOT_CONTROLLER:
      case ARV_DEVICE_ERROR_PROTOCOL_ERROR_ACCESS_DENIED:
      case ARV_DEVICE_ERROR_PROTOCOL_ERROR_BUSY:
        return absl::FailedPreconditionError(text);
      case ARV_DEVICE_ERROR_FEATURE_NOT_FOUND:
      case ARV_DEVICE_ERROR_WRONG_FEATURE:
      case ARV_DEVICE_ERROR_INVALID_PARAMETER:
        return absl::InvalidArgumentError(text);
      default:
        return absl::InternalError(text);
    }
  }

 private:
  GError* error_ = nullptr;
};

}  // namespace rigcal::agent
