PAGE = """# State estimation
"""
