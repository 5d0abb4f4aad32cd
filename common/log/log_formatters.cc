// SPDX-License-Identifier: Apache-2.0
#include "common/log/log_formatters.h"

#include <spdlog/pattern_formatter.h>

#include <chrono>
#include <ctime>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "common/log/log_fields.h"
#include "common/text/printable.h"

namespace rigcal {
namespace {

std::string_view View(const spdlog::string_view_t& text) { return {text.data(), text.size()}; }

// The text of an entry and the request that it is about.
class PrintableText final : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&,
              spdlog::memory_buf_t& destination) override {
    std::string text = Printable(View(message.payload));
    const std::string& correlation = LogFields::Current().correlation;
    if (!correlation.empty()) text += " (correlation " + Printable(correlation) + ")";
    destination.append(text.data(), text.data() + text.size());
  }
  std::unique_ptr<custom_flag_formatter> clone() const override {
    return std::make_unique<PrintableText>();
  }
};

std::string TimeText(spdlog::log_clock::time_point time) {
  const auto since_1970 =
      std::chrono::duration_cast<std::chrono::milliseconds>(time.time_since_epoch()).count();
  const auto seconds = static_cast<std::time_t>(since_1970 / 1000);
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  char text[40];
  const size_t size = std::strftime(text, sizeof(text), "%Y-%m-%dT%H:%M:%S", &utc);
  std::snprintf(text + size, sizeof(text) - size, ".%03dZ", static_cast<int>(since_1970 % 1000));
  return text;
}

class JsonFormatter final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& destination) override {
    nlohmann::ordered_json line = {
        {"time", TimeText(message.time)},
        {"level", std::string(View(spdlog::level::to_string_view(message.level)))},
        {"program", std::string(View(message.logger_name))},
        {"message", std::string(View(message.payload))}};
    const LogFields& fields = LogFields::Current();
    const auto add = [&line](const char* name, const std::string& value) {
      if (!value.empty()) line[name] = value;
    };
    add("session", fields.session);
    add("camera", fields.camera);
    add("calibration", fields.calibration);
    add("correlation", fields.correlation);
    const std::string text =
        line.dump(-1, ' ', /*ensure_ascii=*/true, nlohmann::ordered_json::error_handler_t::replace);
    destination.append(text.data(), text.data() + text.size());
    destination.push_back('\n');
  }
  std::unique_ptr<spdlog::formatter> clone() const override {
    return std::make_unique<JsonFormatter>();
  }
};

}  // namespace

std::unique_ptr<spdlog::formatter> MakeTextFormatter() {
  auto formatter = std::make_unique<spdlog::pattern_formatter>();
  formatter->add_flag<PrintableText>('*').set_pattern("[%Y-%m-%d %H:%M:%S.%e] [%n] [%^%l%$] %*");
  return formatter;
}

std::unique_ptr<spdlog::formatter> MakeJsonFormatter() { return std::make_unique<JsonFormatter>(); }

}  // namespace rigcal
