// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/io/landmark_file.hpp"

#include "lineament/core/error.hpp"
#include "lineament/core/random.hpp"
#include "lineament/io/file.hpp"

#include "support/matchers.hpp"

#include <cmath>
#include <set>

namespace lineament {
namespace {

using test::throws;

// Row i of n holds "100 + i, 200 + 2 i".
std::string pts_rows(int count, const std::string& line_end = "\n")
{
    std::string rows;
    for (int i = 0; i < count; ++i) {
        rows += std::to_string(100 + i) + ".25 " + std::to_string(200 + 2 * i) + line_end;
    }
    return rows;
}

std::string pts(const std::string& rows, const std::string& count = "68")
{
    return "version: 1\nn_points: " + count + "\n{\n" + rows + "}\n";
}

LandmarkFile parse(const std::string& text, const LandmarkFileOptions& options = {})
{
    return parse_landmarks(text, "a.pts", options);
}

void expect_refused(const std::string& text, const std::string& place, const std::string& what,
                    const LandmarkFileOptions& options = {})
{
    EXPECT_TRUE(throws<IoError>([&] { (void)parse(text, options); }, "a.pts:" + place, what)) << text.substr(0, 200);
    try {
        (void)parse(text, options);
    } catch (const IoError& error) {
        EXPECT_EQ(error.kind(), IoErrorKind::content);
    }
}

std::string csv(const std::string& separator, const std::string& row)
{
    return "frame" + separator + " timestamp" + separator + "x_0" + separator + "x_30" + separator + "y_0" + separator +
           "y_30\n" + row + "\n";
}

TEST(LandmarkFile, OneBasedPtsIsMovedByMinusHalfAPixel)
{
    const LandmarkFile file = parse(pts(pts_rows(68)));
    EXPECT_EQ(file.format, LandmarkFormat::pts);
    ASSERT_EQ(file.frames.size(), 1u);
    ASSERT_EQ(file.frames[0].set.landmarks.size(), 68u);
    EXPECT_EQ(file.frames[0].set.scheme, "ibug68");
    EXPECT_EQ(file.frames[0].set.landmarks[67].name, "68");
    EXPECT_EQ(file.frames[0].set.landmarks[67].point_px, Eigen::Vector2d(166.75, 333.5));
    EXPECT_FALSE(file.frames[0].frame.has_value());
}

TEST(LandmarkFile, ZeroBasedPtsIsMovedByPlusHalfAPixel)
{
    const LandmarkFile file = parse(pts(pts_rows(68)), {.pts_origin = PtsOrigin::zero_based});
    EXPECT_EQ(file.frames[0].set.landmarks[0].point_px, Eigen::Vector2d(100.75, 200.5));
}

TEST(LandmarkFile, LineEndsBlankLinesAndByteOrderMarkOfPtsChangeNothing)
{
    const LandmarkSet plain = parse(pts(pts_rows(68))).frames[0].set;
    EXPECT_EQ(parse("\xef\xbb\xbfversion: 1\r\nn_points:  68\r\n{\r\n" + pts_rows(68, "\r\n") + "}").frames[0].set,
              plain);
    EXPECT_EQ(parse("\n\nversion: 1\n\nn_points: 68\n{\n\n" + pts_rows(68, " \n\n\t") + "\n}\n\n").frames[0].set,
              plain);
    EXPECT_EQ(parse("version: 1\rn_points: 68\r{\r" + pts_rows(68, "\r") + "}\r").frames[0].set, plain);
}

TEST(LandmarkFile, PtsPointOfTwiceMinusOneIsMissingAndOthersKeepTheirNames)
{
    const LandmarkSet set = parse(pts("-1 -1\n-1 5\n" + pts_rows(66))).frames[0].set;
    ASSERT_EQ(set.landmarks.size(), 67u);
    EXPECT_FALSE(set.find("1").has_value());
    EXPECT_EQ(set.find("2")->point_px, Eigen::Vector2d(-1.5, 4.5));
    EXPECT_EQ(set.find("3")->point_px, Eigen::Vector2d(99.75, 199.5));
}

TEST(LandmarkFile, FiftyOnePtsPointsAreTheInnerOnes)
{
    const LandmarkSet set = parse(pts(pts_rows(51), "51")).frames[0].set;
    EXPECT_EQ(set.landmarks.front().name, "18");
    EXPECT_EQ(set.landmarks.back().name, "68");
}

TEST(LandmarkFile, HeaderlessPtsNeedsTheOption)
{
    expect_refused(pts_rows(68), "1:1", "headerless");
    const LandmarkFileOptions options = {.pts_header = PtsHeader::optional};
    EXPECT_EQ(parse(pts_rows(68), options).frames[0].set, parse(pts(pts_rows(68))).frames[0].set);
    EXPECT_EQ(parse(pts(pts_rows(68)), options).frames[0].set, parse(pts(pts_rows(68))).frames[0].set);
    expect_refused(pts_rows(65), "65", "found 65", options); // would shift every name
    expect_refused(pts_rows(69), "69:1", "at most 68", options);
    expect_refused(pts_rows(68) + "}\n", "69:1", "without header", options);
}

TEST(LandmarkFile, BrokenPtsIsRefusedWithItsPlace)
{
    for (const char* count : {"67", "0", "-5", "4000000000", "68x", "", "51"}) {
        expect_refused(pts(pts_rows(68), count), "", count);
    }
    expect_refused("version: 1\nn_points: 68\n{\n" + pts_rows(68), "71", "\"}\"");
    expect_refused(pts(pts_rows(67)), "71:1", "there are 67");
    expect_refused(pts("1\n" + pts_rows(67)), "4:1", "two numbers");
    expect_refused(pts("1 2 3\n" + pts_rows(67)), "4:5", "third entry \"3\"");
    expect_refused(pts("1 nan\n" + pts_rows(67)), "4:3", "found \"nan\"");
    expect_refused(pts("inf 1\n" + pts_rows(67)), "4:1", "found \"inf\"");
    expect_refused(pts("1e999 1\n" + pts_rows(67)), "4:1", "found \"1e999\"");
    expect_refused(pts("1e30 1\n" + pts_rows(67)), "4:1", "found \"1e30\"");
    expect_refused(pts("1 2,5\n" + pts_rows(67)), "4:3", "decimal comma");
    expect_refused(pts(pts_rows(68)) + "more", "73:1", "nothing after");
    expect_refused("version: 2\nn_points: 68\n{\n", "1:1", "version 1");
    expect_refused("version: 1\n{\n" + pts_rows(68) + "}", "2:1", "n_points");
    expect_refused("version: 1\nn_points: 68\n" + pts_rows(68) + "}", "3:1", "\"{\"");
    expect_refused("hello", "1:1", "version");
    expect_refused("", "", "empty file");
    expect_refused("\n \n", "", "blank");
    expect_refused(std::string("version: 1\n\0", 12), "2:1", "zero byte");
    expect_refused("\xff\xfev", "byte 0x0", "UTF-16");
    expect_refused("<!DOCTYPE html><html>", "", "web page");
}

TEST(LandmarkFile, EveryCutOfAPtsFileIsRefused)
{
    const std::string whole = pts(pts_rows(68));
    for (std::size_t size = 0; size + 2 < whole.size(); ++size) { // without the last line end it is whole
        EXPECT_TRUE(throws<IoError>([&] { (void)parse(whole.substr(0, size)); }, "a.pts")) << size;
    }
}

TEST(LandmarkFile, IdavLandmarkFileWithTheSameEndingIsRefusedByName)
{
    expect_refused("Version 1.0\n2\nS000  1.5 2.5 3.5\n", "1:1", "IDAV");
}

TEST(LandmarkFile, PointsWithinZeroToOneAreRefusedAsPixelsAndScaledAsNormalized)
{
    std::string rows;
    for (int i = 0; i < 68; ++i) {
        rows += "0.25 0.5\n";
    }
    expect_refused(pts(rows), "", "normalised");
    const LandmarkFileOptions options = {.units = LandmarkUnits::normalized, .image_width = 640, .image_height = 480};
    EXPECT_EQ(parse(pts(rows), options).frames[0].set.landmarks[0].point_px, Eigen::Vector2d(160, 240));
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)parse(pts(rows), {.units = LandmarkUnits::normalized}); }, "size"));
}

TEST(LandmarkFile, CsvIntegersLieOnPixelCentres)
{
    const LandmarkFile file = parse("frame, face_id, timestamp, confidence, success, x_0, x_30, y_0, y_30\n"
                                    "7, 2, 0.25, 0.5, 1, 10, 20, 30, 40.5\n8, 3, 0.5, 0, 0, 0, 0, 0, 0\n");
    EXPECT_EQ(file.format, LandmarkFormat::csv);
    ASSERT_EQ(file.frames.size(), 2u);
    const LandmarkFrame& frame = file.frames[0];
    EXPECT_EQ(frame.frame, 7);
    EXPECT_EQ(frame.face_id, 2);
    EXPECT_EQ(frame.time_s, 0.25);
    ASSERT_EQ(frame.set.landmarks.size(), 2u);
    EXPECT_EQ(frame.set.find("1")->point_px, Eigen::Vector2d(10.5, 30.5));
    EXPECT_EQ(frame.set.find("31")->point_px, Eigen::Vector2d(20.5, 41));
    EXPECT_EQ(frame.set.find("31")->confidence, 0.5);
    EXPECT_TRUE(file.frames[1].set.landmarks.empty()) << "success 0: the face was not found";
}

TEST(LandmarkFile, CsvDialectsReadTheSame)
{
    const LandmarkSet plain = parse(csv(",", "1,0,10,20,30,40")).frames[0].set;
    EXPECT_EQ(plain.landmarks.size(), 2u);
    EXPECT_EQ(parse("\xef\xbb\xbf" + csv(";", "1;0;10;20;30;40")).frames[0].set, plain);
    EXPECT_EQ(parse(csv("\t", "1\t0\t10\t20\t30\t40")).frames[0].set, plain);
    EXPECT_EQ(parse(csv(",", "\"1\",\"0\", \"10\" ,20,30,40\r\n\r\n")).frames[0].set, plain);
    EXPECT_EQ(parse("\"a\nb\"\"\",x_0,x_30,y_0,y_30\n\"q,\n\",10,20,30,40\n").frames[0].set, plain);
}

TEST(LandmarkFile, EmptyCsvCellsAreMissingPoints)
{
    const LandmarkSet set = parse(csv(",", "1,0,,20,,40")).frames[0].set;
    ASSERT_EQ(set.landmarks.size(), 1u);
    EXPECT_EQ(set.landmarks[0].name, "31");
    expect_refused(csv(",", "1,0,10,20,,40"), "2:11", "both coordinates");
}

TEST(LandmarkFile, BrokenCsvIsRefusedWithItsPlaceAndDialect)
{
    expect_refused(csv(";", "1;0;10,5;20;30;40"), "2:5", "decimal comma");
    expect_refused(csv(";", "1;0;10,5;20;30;40"), "2:5", "semicolon");
    expect_refused(csv(",", "1,0,10,20,30"), "2:11", "expected 6 cells");
    expect_refused(csv(",", "1,0,10,20,30,40,5"), "2:17", "found 7");
    expect_refused(csv(",", "1,0,10,20,30,4x"), "2:14", "\"4x\"");
    expect_refused(csv(",", "1,0,nan,20,30,40"), "2:5", "\"nan\"");
    expect_refused(csv(",", "1.5,0,10,20,30,40"), "2:1", "an integer");
    expect_refused("x_0,y_0,x_0\n1,2,3\n", "1:9", "twice");
    expect_refused("x_0,y_1,x_1\n1,2,3\n", "1:1", "\"y_0\"");
    expect_refused("x_0,y_0,x_68,y_68\n1,2,3,4\n", "1:9", "\"x_68\"");
    expect_refused("10,20,30\n", "1:1", "header line");
    expect_refused("a,b\n1,2\n", "1:1", "expected columns x_0");
    expect_refused("x_0,y_0\n", "2:1", "a row");
    expect_refused("x_0,y_0\n\"1,2\n", "2:1", "closing quotation mark");
    std::string wide = "x_0,y_0";
    for (int i = 0; i < 1000000; ++i) {
        wide += ",";
    }
    try {
        (void)parse(wide);
        ADD_FAILURE() << "a million columns were taken";
    } catch (const IoError& error) {
        EXPECT_EQ(error.kind(), IoErrorKind::limit);
    }
}

TEST(LandmarkFile, OwnJsonComesBackBitForBit)
{
    Random random(3);
    LandmarkSet set;
    for (int i = 68; i >= 1; --i) {
        set.landmarks.push_back({std::to_string(i),
                                 {random.uniform(-100.0, 2000.0), random.uniform(0.0, 2000.0)},
                                 i % 3 == 0 ? random.uniform() : 1.0});
    }
    const std::string text = format_landmarks(set, 640, 480);
    const LandmarkFile file = parse(text);
    EXPECT_EQ(file.format, LandmarkFormat::json);
    EXPECT_EQ(file.frames.at(0).set, set);
    EXPECT_EQ(file.image_width, 640);
    EXPECT_EQ(file.image_height, 480);

    test::TemporaryFolder folder;
    save_landmarks(folder / "a.json", set, 640, 480);
    EXPECT_EQ(load_landmarks(folder / "a.json").frames.at(0).set, set);
    EXPECT_TRUE(throws<IoError>([&] { (void)load_landmarks(folder / "b.json"); }, "b.json"));
}

TEST(LandmarkFile, JsonOfAnotherSchemeKeepsItsNames)
{
    const LandmarkSet set = {"own", {{"nose tip", {5, 6}}, {"\xc3\xa9", {7, 8}}}};
    EXPECT_EQ(parse(format_landmarks(set, 10, 10)).frames[0].set, set);
}

Eigen::Matrix2d covariance_of(double xx, double xy, double yy)
{
    Eigen::Matrix2d covariance;
    covariance << xx, xy, xy, yy;
    return covariance;
}

TEST(LandmarkFile, CovariancesGoThroughOurOwnFormat)
{
    const LandmarkSet set = {.landmarks = {{"9", {1, 2}}, {"31", {3, 4}}}};
    const std::vector<Eigen::Matrix2d> covariances = {covariance_of(4, 1, 2), covariance_of(0.1, -0.01, 9)};
    EXPECT_EQ(parse(format_landmarks(set, 640, 480, covariances)).frames[0].covariances_px, covariances);
    EXPECT_TRUE(parse(format_landmarks(set, 640, 480)).frames[0].covariances_px.empty());

    // In the order of the points, whichever is that of the covariances; scaled with them.
    const std::string text = R"({"format":"lineament-landmarks","version":1,"scheme":"ibug68",
        "image":{"width":640,"height":480}, "covariances_px":{"31":[1e-4,1e-5,2e-4],"9":[1,0,1]},
        "points":{"9":[0.5,0.5],"31":[0.25,0.25]}})";
    const LandmarkFrame frame =
        parse(text, {.units = LandmarkUnits::normalized, .image_width = 640, .image_height = 480}).frames[0];
    ASSERT_EQ(frame.covariances_px.size(), 2U);
    EXPECT_EQ(frame.set.landmarks[1].name, "31");
    EXPECT_TRUE(frame.covariances_px[1].isApprox(covariance_of(1e-4 * 640 * 640, 1e-5 * 640 * 480, 2e-4 * 480 * 480)));
}

TEST(LandmarkFile, CovariancesThatAreNoneAreRefused)
{
    const auto file = [](const std::string& covariances) {
        return R"({"format":"lineament-landmarks","version":1,"scheme":"ibug68","image":{"width":9,"height":9},
                   "points":{"1":[5,6],"2":[7,8]},"covariances_px":)" +
               covariances + "}";
    };
    EXPECT_EQ(parse(file(R"({"1":[1,0,1],"2":[1,0.9,1]})")).frames[0].covariances_px.size(), 2U);
    expect_refused(file(R"({"1":[1,0,1]})"), "/covariances_px/2", "found none");
    expect_refused(file(R"({"1":[1,0,1],"2":[1,0,1],"3":[1,0,1]})"), "/covariances_px/3", "one of the points");
    expect_refused(file(R"({"1":[1,0,1],"2":[1,1,1]})"), "/covariances_px/2", "positive definite");
    expect_refused(file(R"({"1":[1,0,1],"2":[-1,0,-1]})"), "/covariances_px/2", "positive definite");
    expect_refused(file(R"({"1":[1,0,1],"2":[1,0]})"), "/covariances_px/2", "[xx, xy, yy]");
    expect_refused(file(R"({"1":[1,0,1],"2":[1,0,"1"]})"), "/covariances_px/2/2", "a number");
    expect_refused(file("[]"), "/covariances_px", "an object");

    const auto format = [](const std::vector<Eigen::Matrix2d>& covariances) {
        (void)format_landmarks({"ibug68", {{"1", {5, 6}}}}, 9, 9, covariances);
    };
    format({covariance_of(1, 0, 1)});
    EXPECT_TRUE(throws<InvalidArgument>([&] { format({covariance_of(1, 2, 1)}); }, "positive definite"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { format({covariance_of(std::nan(""), 0, 1)}); }, "positive definite"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { format(std::vector(2, covariance_of(1, 0, 1))); }, "one for each"));
}

TEST(LandmarkFile, WriterRefusesWhatTheReaderWould)
{
    const auto format = [](const Landmark& landmark) { (void)format_landmarks({"ibug68", {landmark}}, 10, 10); };
    EXPECT_TRUE(throws<InvalidArgument>([&] { format({"1", {std::nan(""), 1}}); }, "finite"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { format({"1", {1, 1}, 2.0}); }, "confidence"));
    EXPECT_TRUE(throws<InvalidArgument>([&] { format({"", {1, 1}}); }, "names"));
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)format_landmarks({"s", {{"1"}, {"1"}}}, 10, 10); }, "names"));
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)format_landmarks({}, 0, 10); }, "0 x 10"));
}

TEST(LandmarkFile, BrokenJsonIsRefusedWithItsPlace)
{
    const std::string head = R"({"format":"lineament-landmarks","version":1,"scheme":"ibug68",)";
    const std::string image = R"("image":{"width":9,"height":9},)";
    EXPECT_EQ(parse(head + image + R"("points":{"1":[5,6]}})").frames[0].set.landmarks.size(), 1u);
    expect_refused(head + image + R"("points":{"69":[5,6]}})", "/points/69", "the name \"69\"");
    expect_refused(head + image + R"("points":{"01":[5,6]}})", "/points/01", "ibug68");
    expect_refused(R"({"format":"lineament-landmarks","version":1,"scheme":"s",)" + image + R"("points":{"":[5,6]}})",
                   "/points/", "empty name");
    expect_refused(head + image + R"("points":{"1":[5]}})", "/points/1", "[x, y]");
    expect_refused(head + image + R"("points":{"1":[5,"6"]}})", "/points/1/1", "a number");
    expect_refused(head + image + R"("points":{"1":[5,1e30]}})", "/points/1/1", "1e7");
    expect_refused(head + image + R"("points":{"1":[5,6,1.5]}})", "/points/1/2", "confidence");
    expect_refused(head + image + R"("points":{"1":[5,6],"1":[5,6]}})", "/points/1:", "stands twice");
    expect_refused(head + image + R"("points":[]})", "/points", "an object");
    expect_refused(head + R"("points":{}})", "/image", "found none");
    expect_refused(head + R"("image":{"width":0,"height":9},"points":{}})", "/image/width", "integer");
    expect_refused(R"({"format":"lineament-landmarks","version":2})", "/version", "version 1");
    expect_refused(R"({"format":"other"})", "/format", "lineament-landmarks");
    expect_refused("{}", "/format", "lineament-landmarks");
    expect_refused("{\n \"a\": 1,\n}", "3:1", "found \"}\"");
    expect_refused(R"({"a":1e400})", "/a:", "too large");
    expect_refused(R"({"a":{"b":[{},[0]]},"c":[[1,{"d":2}],[3,1e400]]})", "/c/1/1:", "too large");
    expect_refused(R"({"a":[{},[0],{"b":1,"c":{"b":1},"b":2}]})", "/a/2/b:", "stands twice");
    expect_refused(R"({"a":"\ud800"})", "1:", "not valid JSON");
    expect_refused("{} {}", "1:4", "not valid JSON");
    expect_refused("[" + std::string(100000, '['), "1:65", "64 levels");
}

std::string mediapipe_points(int count, const std::string& item = R"({"x":0.5,"y":0.25,"z":-0.1})")
{
    std::string points = "[" + item;
    for (int i = 1; i < count; ++i) {
        points += ',';
        points += item;
    }
    points += ']';
    return points;
}

TEST(LandmarkFile, MediapipePointsAreScaledByTheImageSizeWithoutShift)
{
    const LandmarkFileOptions options = {.image_width = 640, .image_height = 480};
    for (const std::string& text :
         {"{\"faceLandmarks\":[" + mediapipe_points(478) + "]}", "{\"face_landmarks\":[" + mediapipe_points(478) + "]}",
          mediapipe_points(468), "[" + mediapipe_points(468, "[0.5,0.25,0]") + "]"}) {
        const LandmarkFile file = parse(text, options);
        EXPECT_EQ(file.format, LandmarkFormat::mediapipe);
        ASSERT_EQ(file.frames.size(), 1u);
        EXPECT_EQ(file.frames[0].set.landmarks.size(), 52u) << "51 inner points and the chin";
        EXPECT_EQ(file.frames[0].set.find("31")->point_px, Eigen::Vector2d(320, 120));
    }
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)parse(mediapipe_points(468)); }, "image_width"));
    expect_refused(mediapipe_points(467), "/", "468 or 478", options);
    EXPECT_TRUE(parse("{\"faceLandmarks\":[]}", options).frames.empty()) << "no face found";
}

TEST(LandmarkFile, MediapipeDepthIsScaledByTheWidth)
{
    const LandmarkFileOptions options = {.image_width = 640, .image_height = 480};
    const auto depth_of = [&](const std::string& text) {
        return parse(text, options).frames[0].set.find("31")->depth_px;
    };
    EXPECT_EQ(depth_of(mediapipe_points(478)), -64.0);
    EXPECT_EQ(depth_of(mediapipe_points(468, "[0.5,0.25,0.2]")), 128.0);
    EXPECT_EQ(depth_of("{\"keypoints\":" + mediapipe_points(478, R"({"x":5,"y":2,"z":-3})") + "}"), -3.0);
    EXPECT_EQ(depth_of(mediapipe_points(468, "[0.5,0.25,0]")), std::nullopt) << "zero everywhere: no depth was written";
    EXPECT_EQ(depth_of(mediapipe_points(468, "[0.5,0.25]")), std::nullopt);
    std::string mixed = mediapipe_points(468, "[0.5,0.25]");
    mixed.replace(1, 10, "[0.5,0.25,1]"); // point 0 alone has a depth
    EXPECT_EQ(depth_of(mixed), std::nullopt);
    expect_refused(mediapipe_points(468, R"([0.5,0.25,"far"])"), "/0/2", "number", options);
}

TEST(LandmarkFile, DepthGoesThroughOurOwnFormat)
{
    const LandmarkSet set = {.landmarks = {{"9", {1, 2}, 1.0, -7.25}, {"31", {3, 4}, 0.5, std::nullopt}}};
    EXPECT_EQ(parse(format_landmarks(set, 640, 480)).frames[0].set.find("9"), set.find("9"));
    EXPECT_EQ(parse(format_landmarks(set, 640, 480)).frames[0].set.find("31"), set.find("31"));
    const std::string normalized = R"({"format": "lineament-landmarks", "version": 1, "scheme": "ibug68",
        "image": {"width": 640, "height": 480}, "points": {"9": [0.5, 0.5, 1, -0.1]}})";
    EXPECT_EQ(parse(normalized, {.units = LandmarkUnits::normalized, .image_width = 640, .image_height = 480})
                  .frames[0]
                  .set.find("9")
                  ->depth_px,
              -64.0);
    LandmarkSet broken = set;
    broken.landmarks[0].depth_px = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)format_landmarks(broken, 640, 480); }, "depth_px"));
}

TEST(LandmarkFile, MediapipePointsKeepTheirNumbersIfAsked)
{
    for (const int count : {468, 478}) {
        const LandmarkFile file =
            parse(mediapipe_points(count),
                  {.mediapipe_points = MediapipePoints::mediapipe478, .image_width = 640, .image_height = 480});
        ASSERT_EQ(file.frames.size(), 1u);
        const LandmarkSet& set = file.frames[0].set;
        EXPECT_EQ(set.scheme, "mediapipe478");
        ASSERT_EQ(set.landmarks.size(), static_cast<std::size_t>(count));
        EXPECT_EQ(set.landmarks.front().name, "0");
        EXPECT_EQ(set.landmarks.back().name, std::to_string(count - 1));
        EXPECT_EQ(set.find("467")->point_px, Eigen::Vector2d(320, 120));
    }
}

TEST(LandmarkFile, TwoMediapipeFacesAreTwoFrames)
{
    const LandmarkFile file = parse("{\"faceLandmarks\":[" + mediapipe_points(478) + "," + mediapipe_points(478) + "]}",
                                    {.image_width = 100, .image_height = 100});
    ASSERT_EQ(file.frames.size(), 2u);
    EXPECT_EQ(file.frames[1].face_id, 1);
}

TEST(LandmarkFile, MediapipeTableNamesEachInnerPointOnce)
{
    std::set<int> names;
    for (int i = -1; i < 500; ++i) {
        const std::string name = ibug68_name_of_mediapipe_point(i);
        if (!name.empty()) {
            EXPECT_TRUE(names.insert(std::stoi(name)).second) << name;
        }
    }
    EXPECT_EQ(names.size(), 52u);
    EXPECT_EQ(*names.begin(), 9);
    EXPECT_EQ(*std::next(names.begin()), 18);
    EXPECT_EQ(*names.rbegin(), 68);
}

} // namespace
} // namespace lineament
