set(headers angles.hpp camera.hpp)
