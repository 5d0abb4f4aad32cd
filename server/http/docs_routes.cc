// SPDX-License-Identifier: Apache-2.0
#include "server/http/docs_routes.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_split.h"
#include "common/identity/private_key.h"
#include "server/api/url_text.h"
#include "server/http/content_type.h"

namespace rigcal::server {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPrefix = "/docs/";
constexpr char kIndex[] = "index.html";
constexpr uintmax_t kMaxFileBytes = uintmax_t{32} << 20;
constexpr size_t kDocsHashBytes = 8;

HttpResponse NotFound(const char* sentence) {
  return {.status = 404, .body = std::string(sentence) + "\n"};
}

HttpResponse NoDocs() {
  return NotFound(
      "The documentation is not on this server: sudo apt install rigcal-doc, or name its folder "
      "with rigcal-server --docs-dir.");
}

HttpResponse NoSuchPage() {
  return NotFound("The documentation has no such page; /docs/ lists all.");
}

HttpResponse MovedTo(const std::string& path) {
  HttpResponse response{.status = 308, .body = path + "\n"};
  response.headers.emplace_back("Location", path);
  return response;
}

// "wand/build.html" of a request's path; none: it names nothing that the folder may hold. An empty
// part at the end means the index of a folder.
std::optional<fs::path> NameOf(std::string_view path) {
  const std::optional<std::string> text = DecodeUrlText(path.substr(kPrefix.size()), false);
  if (!text || text->find('\\') != std::string::npos) return std::nullopt;
  fs::path name;
  const std::vector<std::string> parts = absl::StrSplit(*text, '/');
  for (size_t i = 0; i < parts.size(); ++i) {
    const bool is_folder = parts[i].empty() && i + 1 == parts.size();
    if (!is_folder && (parts[i].empty() || parts[i].front() == '.')) return std::nullopt;
    name /= is_folder ? kIndex : parts[i];
  }
  return name;
}

// The file or folder itself, links followed; none: it is not there, or outside of `folder`.
std::optional<fs::path> Inside(const fs::path& folder, const fs::path& name) {
  std::error_code error;
  const fs::path root = fs::canonical(folder, error);
  if (error) return std::nullopt;
  fs::path file = fs::canonical(root / name, error);
  if (error) return std::nullopt;
  const bool is_inside = std::ranges::mismatch(root, file).in1 == root.end();
  return is_inside ? std::optional(std::move(file)) : std::nullopt;
}

HttpResponse FileResponse(const fs::path& file) {
  std::error_code error;
  const bool is_file = fs::is_regular_file(file, error);
  if (!is_file || fs::file_size(file, error) > kMaxFileBytes || error) return NoSuchPage();
  std::ifstream stream(file, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  if (!stream) {
    spdlog::warn("the page {} of the documentation cannot be read", file.string());
    return NoSuchPage();
  }
  HttpResponse response{.content_type = ContentTypeOf(file.filename().string()),
                        .cache_control = "no-cache"};
  response.etag = absl::BytesToHexString(Sha256(text).substr(0, kDocsHashBytes));
  response.body = std::move(text);
  return response;
}

HttpResponse Docs(const fs::path& folder, const std::string& path) {
  if (!Inside(folder, kIndex)) return NoDocs();
  const std::optional<fs::path> name = NameOf(path);
  if (!name) return NoSuchPage();
  const std::optional<fs::path> file = Inside(folder, *name);
  if (!file) return NoSuchPage();
  std::error_code error;
  if (fs::is_directory(*file, error)) return MovedTo(path + "/");
  return FileResponse(*file);
}

}  // namespace

fs::path DefaultDocsFolder() {
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  return error ? fs::path("/usr/share/doc/rigcal/html")
               : self.parent_path().parent_path() / "share/doc/rigcal/html";
}

std::vector<HttpRoute> DocsRoutes(const fs::path& folder) {
  return {{.method = "GET",
           .path = "/docs.json",
           .handle =
               [folder](const HttpRequest&) {
                 const bool is_there = Inside(folder, kIndex).has_value();
                 return HttpResponse{.content_type = "application/json",
                                     .body = is_there ? "{\"is_there\":true}" : "{}"};
               },
           .who = HttpRoute::For::kPages},
          {.method = "GET",
           .path = "/docs",
           .handle =
               [folder](const HttpRequest&) {
                 return Inside(folder, kIndex) ? MovedTo(std::string(kPrefix)) : NoDocs();
               },
           .who = HttpRoute::For::kPages},
          {.method = "GET",
           .path = std::string(kPrefix) + "*",
           .begin =
               [folder](const HttpRequest& request, const std::function<void(HttpWork)>& done) {
                 done([folder, path = request.path] { return Docs(folder, path); });
               },
           .who = HttpRoute::For::kPages}};
}

}  // namespace rigcal::server
