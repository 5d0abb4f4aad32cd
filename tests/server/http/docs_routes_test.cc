// SPDX-License-Identifier: Apache-2.0
#include "server/http/docs_routes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include "server/http/web_server.h"
#include "tests/server/http/echo_gateway.h"
#include "tests/server/http/join_fixture.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::docs_routes_test {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;

// A server over HTTP with a folder of documentation, and a secret beside that.
class DocsRoutes : public ::testing::Test {
 protected:
  DocsRoutes() {
    Write("html/index.html", "<h1>rigcal</h1>");
    Write("html/wand/index.html", "<h1>A wand</h1>");
    Write("html/wand/step 1.svg", "<svg/>");
    Write("html/site.css", "body {}");
    Write("html/search/search_index.js", "window.searchIndex = {};");
    Write("html/images/wave.webp", "RIFF");
    Write("html/.hidden", "secret");
    Write("html2/beside.html", "secret");
    Write("secret.txt", "secret");
    fs::create_symlink(folder_.path() / "secret.txt", folder_.path() / "html/out.html");
    fs::create_symlink("..", folder_.path() / "html/up");
    fs::create_symlink("site.css", folder_.path() / "html/also.css");
  }
  void Write(const std::string& name, const std::string& text) {
    fs::create_directories((folder_.path() / name).parent_path());
    std::ofstream(folder_.path() / name) << text;
  }
  void SetUp() override { Start("html"); }
  void Start(const std::string& name) {
    server_.reset();
    server::WebServerOptions options;
    options.data_dir = data_.path();
    options.grpc_listen = "127.0.0.1:0";
    options.docs_dir = folder_.path() / name;
    auto opened = server::WebServer::Open(options);
    ASSERT_THAT(opened, IsOk());
    server_ = *std::move(opened);
    ASSERT_THAT(
        server_->Start(7420, {.gateway = &gateway_, .api_description = "{}", .metrics = {}}),
        IsOk());
  }
  // `target` goes over the wire as it is.
  std::string Ask(const std::string& target, const std::string& method = "GET",
                  const std::string& headers = "Host: 127.0.0.1\r\n") {
    const RawSocket socket(server_->port());
    socket.Send(method + " " + target + " HTTP/1.1\r\nConnection: close\r\n" + headers + "\r\n");
    return socket.ReadToEnd(30);
  }

  TemporaryDirectory data_, folder_;
  EchoGateway gateway_;
  std::unique_ptr<server::WebServer> server_;
};

TEST_F(DocsRoutes, ServesFilesWithTheirTypes) {
  EXPECT_THAT(Ask("/docs/"), AllOf(StartsWith("HTTP/1.1 200"), EndsWith("<h1>rigcal</h1>"),
                                   HasSubstr("Content-Type: text/html; charset=utf-8\r\n")));
  EXPECT_THAT(Ask("/docs/index.html"), EndsWith("<h1>rigcal</h1>"));
  EXPECT_THAT(Ask("/docs/wand/"), EndsWith("<h1>A wand</h1>"));
  EXPECT_THAT(Ask("/docs/wand/step%201.svg"),
              AllOf(HasSubstr("Content-Type: image/svg+xml\r\n"), EndsWith("<svg/>")));
  EXPECT_THAT(Ask("/docs/site.css?v=1"), HasSubstr("Content-Type: text/css"));
  EXPECT_THAT(Ask("/docs/search/search_index.js"), HasSubstr("Content-Type: text/javascript"));
  EXPECT_THAT(Ask("/docs/images/wave.webp"), HasSubstr("Content-Type: image/webp\r\n"));
  EXPECT_THAT(Ask("/docs/also.css"), EndsWith("body {}"));
}

TEST_F(DocsRoutes, FoldersLeadToTheirIndex) {
  EXPECT_THAT(Ask("/docs"), AllOf(StartsWith("HTTP/1.1 308"), HasSubstr("Location: /docs/\r\n")));
  EXPECT_THAT(Ask("/docs/wand"),
              AllOf(StartsWith("HTTP/1.1 308"), HasSubstr("Location: /docs/wand/\r\n")));
  EXPECT_THAT(Ask("/docs.json"), EndsWith("{\"is_there\":true}"));
}

TEST_F(DocsRoutes, HeadAndEtagsSpareTheBody) {
  const std::string head = Ask("/docs/", "HEAD");
  EXPECT_THAT(head, AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("Content-Length: 15\r\n"),
                          EndsWith("\r\n\r\n")));
  const size_t begin = head.find("ETag: ") + 6;
  ASSERT_LT(begin, head.size());
  const std::string etag = head.substr(begin, head.find("\r\n", begin) - begin);
  const std::string again = "Host: 127.0.0.1\r\nIf-None-Match: " + etag + "\r\n";
  EXPECT_THAT(Ask("/docs/", "GET", again), StartsWith("HTTP/1.1 304"));
  // A package has brought another one.
  Write("html/index.html", "<h1>new</h1>");
  EXPECT_THAT(Ask("/docs/", "GET", again), EndsWith("<h1>new</h1>"));
  EXPECT_THAT(Ask("/docs/", "POST"), StartsWith("HTTP/1.1 405"));
}

TEST_F(DocsRoutes, NothingOutsideOfTheFolderIsRead) {
  for (const char* target : {"/docs/../secret.txt",
                             "/docs/%2e%2e/secret.txt",
                             "/docs/%2E%2E%2Fsecret.txt",
                             "/docs/..%2fsecret.txt",
                             "/docs/..%5csecret.txt",
                             "/docs/..\\secret.txt",
                             "/docs/wand/../../secret.txt",
                             "/docs/wand/%2e%2e/%2e%2e/secret.txt",
                             "/docs/%252e%252e/secret.txt",
                             "/docs//secret.txt",
                             "/docs/./../secret.txt",
                             "/docs/out.html",
                             "/docs/up/secret.txt",
                             "/docs/up/",
                             "/docs/up/html2/beside.html",
                             "/docs/../html2/beside.html",
                             "/docs/.hidden",
                             "/docs/%2ehidden",
                             "/docs/%00",
                             "/docs/index.html%00.css",
                             "/docs/%",
                             "/docs/%zz",
                             "/docs/%ff",
                             "/docs//etc/passwd",
                             "/docs/%2fetc%2fpasswd",
                             "/docs//",
                             "/docs/index.html/",
                             "/docs/no.html"}) {
    EXPECT_THAT(Ask(target), AllOf(StartsWith("HTTP/1.1 404"),
                                   EndsWith("has no such page; /docs/ lists all.\n")))
        << target;
  }
  // What HTTP itself does not allow.
  EXPECT_THAT(Ask("/../secret.txt"), StartsWith("HTTP/1.1 404"));
  EXPECT_THAT(Ask("/docs/wand/" + std::string(3000, 'a')), StartsWith("HTTP/1.1 404"));
}

TEST_F(DocsRoutes, OnlyUnderANameOfTheServer) {
  EXPECT_THAT(Ask("/docs/", "GET", "Host: evil.example\r\n"), StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(Ask("/docs.json", "GET", "Host: evil.example\r\n"), StartsWith("HTTP/1.1 403"));
}

TEST_F(DocsRoutes, WhereTheyAreMissingItSaysHowToGetThem) {
  Start("nowhere");
  for (const char* target : {"/docs", "/docs/", "/docs/live.html", "/docs/../secret.txt"}) {
    EXPECT_THAT(Ask(target),
                AllOf(StartsWith("HTTP/1.1 404"), HasSubstr("sudo apt install rigcal-doc")))
        << target;
  }
  EXPECT_THAT(Ask("/docs.json"), EndsWith("\r\n\r\n{}"));
  // They come while the server runs.
  Write("nowhere/index.html", "<h1>here</h1>");
  EXPECT_THAT(Ask("/docs/"), EndsWith("<h1>here</h1>"));
}

TEST(DefaultDocsFolder, IsBesideTheFolderOfTheProgram) {
  EXPECT_EQ(
      server::DefaultDocsFolder(),
      fs::read_symlink("/proc/self/exe").parent_path().parent_path() / "share/doc/rigcal/html");
}

}  // namespace
}  // namespace rigcal::testing::docs_routes_test
