// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Opens the pages in Chromium and asks what their scripts made of them.
#include "report/report_fixtures.hpp"
#include "support/chromium.hpp"

#include <fstream>

namespace lineament {
namespace {

// The page's document after its scripts have run.
std::string document_of(const std::string& page, const std::string& more_options = "")
{
    const test::TemporaryFolder folder;
    std::ofstream(folder / "page.html") << page;
    return test::document_of_page(folder, "page.html", more_options);
}

// The opening html tag, which carries data-error if a script failed.
std::string root_of(const std::string& document)
{
    return test::text_between(document, "<html", ">");
}

TEST(Browser, FitReportShowsItsFaceWithoutAnError)
{
    LINEAMENT_REQUIRE_CHROMIUM();
    const std::string document = document_of(format_fit_report(test::make_fit_report(1, "a.jpg")));
    EXPECT_NE(document.find("data-viewer=\"ready\""), std::string::npos);
    EXPECT_NE(document.find("<canvas"), std::string::npos);
    EXPECT_EQ(root_of(document).find("data-error"), std::string::npos) << root_of(document);
}

TEST(Browser, FitReportOfTwoFacesShowsTheFirst)
{
    LINEAMENT_REQUIRE_CHROMIUM();
    const std::string document = document_of(format_fit_report(test::make_fit_report(2, test::canary)));
    EXPECT_NE(document.find("data-viewer=\"ready\""), std::string::npos);
    EXPECT_EQ(root_of(document).find("data-error"), std::string::npos) << root_of(document);
}

TEST(Browser, TrackReportPlaysWithoutAnError)
{
    LINEAMENT_REQUIRE_CHROMIUM();
    const std::string document = document_of(format_track_report(test::make_track_report("clip.mp4")));
    EXPECT_NE(document.find("data-viewer=\"ready\""), std::string::npos);
    EXPECT_NE(document.find("class=\"playback\""), std::string::npos);
    EXPECT_EQ(root_of(document).find("data-error"), std::string::npos) << root_of(document);
}

TEST(Browser, WithoutWebGlThePageSaysSo)
{
    LINEAMENT_REQUIRE_CHROMIUM();
    const std::string document = document_of(format_fit_report(test::make_fit_report(1, "a.jpg")), "--disable-3d-apis");
    EXPECT_NE(document.find("data-viewer=\"no-webgl\""), std::string::npos);
    EXPECT_NE(document.find("offers no WebGL"), std::string::npos);
    EXPECT_EQ(root_of(document).find("data-error"), std::string::npos) << root_of(document);
}

TEST(Browser, AnErrorInAScriptIsSeen)
{
    LINEAMENT_REQUIRE_CHROMIUM();
    std::string page = format_fit_report(test::make_fit_report(1, "a.jpg"));
    page.replace(page.find("\"vertices\":\""), 12, "\"vertices\":\"!"); // no longer base64
    const std::string document = document_of(page);
    EXPECT_NE(root_of(document).find("data-error"), std::string::npos);
    EXPECT_EQ(document.find("data-viewer=\"ready\""), std::string::npos);
}

} // namespace
} // namespace lineament
