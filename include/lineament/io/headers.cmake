set(headers
    file.hpp
)
